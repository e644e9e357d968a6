"""Memory budget of the EFM32GG280F1024 on CubeStar: size and place of every buffer.

CubeStar thesis, sections 3.2 and 5.2.1 (128 kB of RAM, 1024 kB of flash, 1024 kB of SRAM on the
external bus), appendix E (retention registers, 512 bytes), section 5.3.2 (catalogue as constant
arrays in flash) and 5.3.4 (preallocated arrays). Sizes are those of the part's program: derived
from the tables, the settings' limits and the catalogue where these determine them. Program code is
not modelled, so flash and RAM must leave room for it.
"""

import numpy as np

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.detection.background_search import (
    MOST_AREAS,
    MOST_SHAPES,
    MOST_STARS_FACTOR,
)
from cubestack.firmware_model.cubestar.detection.spots import HALF
from cubestack.firmware_model.cubestar.earlier_stars import EarlierStars
from cubestack.firmware_model.cubestar.link import SEND_BUFFER_BYTES
from cubestack.firmware_model.cubestar.matching.pair_triangles import MOST_PAIRS
from cubestack.firmware_model.cubestar.matching.voting import CUT_RADIUS_DEG
from cubestack.firmware_model.cubestar.state import (
    ATTITUDE_PAGE,
    BODIES_PAGE,
    CONFIG_PAGE,
    MODE_PAGE,
    State,
)
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES, INTERFACE
from cubestack.firmware_model.interface.cubestar.telecommands import MOST_STARS
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.memory import Buffer, Memory
from cubestack.firmware_model.node.commands import QUEUE_DEPTH
from cubestack.firmware_model.node.link import longest_command
from cubestack.firmware_model.star_tracker.background import CELL

KB = 1024
EXTERNAL_RAM_BYTES = 1024 * KB
RETENTION_BYTES = 512

FLASH_PAGE_BYTES = 4 * KB  #: smallest part of this flash that can be erased

#: Main program and nested interrupts, without the recursion of region growing: assumed.
STACK_BYTES = 4 * KB

#: One level of region growing: four registers and the return address, as in the cost table.
GROW_FRAME_BYTES = 5 * 4

DIRECTIONS = 500  #: tested directions of the reduced catalogue, about 9 deg apart

#: Size of each memory in bytes.
CAPACITY = {
    Memory.RAM: 128 * KB,
    Memory.FLASH: 1024 * KB,
    Memory.EXTERNAL_RAM: EXTERNAL_RAM_BYTES,
    Memory.RETENTION: RETENTION_BYTES,
}


def _limit(command: str, field: str) -> int:
    declared = INTERFACE.telecommand(command).field(field)
    largest = min(declared.raw_range[1], declared.high)
    return int(max(largest, declared.also or 0))


def budget(catalogue: StarCatalogue) -> tuple[Buffer, ...]:
    """Every buffer of the program with ``catalogue`` in its flash, at the settings' limits."""
    stars = MOST_STARS
    pairs = stars * (stars - 1) // 2
    pixels = _limit("setStarPixels", "MaxPixels")
    invalid = _limit("setDetectionVariables", "MaxInvalidStars") + 1
    noise = _limit("setDetectionVariables", "MaxNoise") + 1
    visited = (stars + invalid) * pixels + noise * (pixels - 1)
    listed = len(catalogue)
    kept = EarlierStars.LAYOUT.size
    longest_answer = max(message.length for message in INTERFACE.telemetries)
    ram = {
        # centroid, undistorted point, camera vector; size, intensity, identity, votes
        "detected stars": stars * (4 * (2 + 2 + 3) + 1 + 2 + 2 + 1),
        # position in the image (19 bits) and value (8 bits) in one word
        "area being grown": pixels * 4,
        "recursion of region growing": pixels * GROW_FRAME_BYTES,
        **_background_search(),
        # angle; first entry and number of entries in the pair list
        "pairs of stars": pairs * (4 + 2 + 2),
        # the stellar gyro, which runs before the identification, uses them for its pairs
        "votes": stars * listed * 2,
        # star, older centroid and its star, next of the same star
        "pairs with the newest star": MOST_PAIRS * (2 + 1 + 2 + 2),
        "agreement of the stars": stars * stars,
        "marks of the reduced catalogue": listed,
        "reduced pair list": _largest_reduction(catalogue) * (2 + 2 + 4),
        "received frame, I2C message, waiting telecommands": (2 + QUEUE_DEPTH)
        * (longest_command(INTERFACE) + 1),
        "I2C answer": longest_answer,
        "UART send buffer": SEND_BUFFER_BYTES,
        "settings, flags and counters": State.RETENTION_SIZE,
        "stack": STACK_BYTES,
    }
    return (
        *(Buffer(name, Memory.RAM, size) for name, size in ram.items()),
        Buffer("image", Memory.EXTERNAL_RAM, IMAGE_BYTES),
        Buffer("visited pixels", Memory.EXTERNAL_RAM, visited * 4),
        Buffer("star list", Memory.FLASH, catalogue.star_bytes),
        Buffer("pair list", Memory.FLASH, catalogue.pair_bytes),
        *(
            Buffer(f"page {page}", Memory.FLASH, FLASH_PAGE_BYTES)
            for page in (CONFIG_PAGE, ATTITUDE_PAGE, MODE_PAGE, BODIES_PAGE)
        ),
        Buffer("settings, flags and counters", Memory.RETENTION, State.RETENTION_SIZE - kept),
        Buffer("stars of the image before", Memory.RETENTION, kept),
    )


def _background_search() -> dict[str, int]:
    cells = -(-ROWS // CELL) * -(-COLUMNS // CELL)
    runs = COLUMNS // 2  # of a row, at most
    window = (2 * HALF + 1) ** 2
    return {
        "level and noise of the background": cells * (2 + 2),
        "steep cells, and blind cells": 2 * cells // 8,
        "level in DN where a row is steep": COLUMNS,
        "histogram of a cell": 256 * 2,
        # the next one is read into the oldest
        "three rows of the image": 3 * COLUMNS,
        # first and last column, area
        "runs of two rows": 2 * runs * (2 + 2 + 2),
        # pixels; first position; brightest position, signal; light, two 1st and three 2nd moments
        "areas that may continue": runs * (2 + 4 + 4 + 2 + 6 * 4),
        # pixels, brightest position, light, position
        "brightest areas": MOST_AREAS * (2 + 4 + 4 + 2 * 4),
        # signal; the same cleaned, weights
        "window around a star": window * (2 + 2 + 2),
        # width, noise, start and marks of the examined ones
        "shapes of areas": MOST_SHAPES * (2 + 2 + 2 * 2 + 1),
        # centroid, undistorted point, vector, expected error; size, intensity
        "stars beyond the published list": MOST_STARS
        * (MOST_STARS_FACTOR - 1)
        * (4 * (2 + 2 + 3) + 1 + 2)
        + MOST_STARS * MOST_STARS_FACTOR * 4,
    }


def _largest_reduction(catalogue: StarCatalogue) -> int:
    """Largest number of pairs in the reduced catalogue, over evenly spread directions."""
    step = np.arange(DIRECTIONS) + 0.5
    z = 1 - 2 * step / DIRECTIONS  # on a spiral from pole to pole
    turn = step * np.pi * (3 - np.sqrt(5))
    radius = np.sqrt(1 - z * z)
    directions = np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)
    meter = Meter(CORTEX_M3)
    return max(
        len(catalogue.reduced(direction, CUT_RADIUS_DEG, meter)[1])
        for direction in directions.astype(np.float32)
    )
