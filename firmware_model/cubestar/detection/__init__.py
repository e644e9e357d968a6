"""Detection of stars in an image: the published search, and the one above the background.

A search yields the pixels that it reads and writes in order; the caller performs the accesses, on
an array or on a memory behind an FPGA.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection.background_search import background_search
from cubestack.firmware_model.cubestar.detection.contract import (
    Detection,
    DetectionConfig,
    DetectionConfigError,
    Look,
    PictureStatistics,
    Put,
    Search,
    SearchEnd,
)
from cubestack.firmware_model.cubestar.detection.sampled import (
    SAMPLED_SEARCH,
    compiled_search,
    sampled_search,
)
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.inner_loops import BYTES, INT, INT32S, Loop

__all__ = [
    "Detection",
    "DetectionConfig",
    "DetectionConfigError",
    "Look",
    "PictureStatistics",
    "Put",
    "Search",
    "SearchEnd",
    "detect_stars",
    "search_stars",
]

_LOOK = Loop("look_at", BYTES, INT32S, INT, INT, BYTES)


def detect_stars(image: NDArray[np.uint8], config: DetectionConfig, meter: Meter) -> Detection:
    """Find the stars of an image (rows, columns) of 8-bit values, which is not changed.

    Charges what ``search_stars`` charges, and every access. Raises DetectionConfigError when the
    region reaches beyond the image.
    """
    rows, columns = image.shape
    pixels = image.reshape(-1).copy()
    if SAMPLED_SEARCH and not config.background:
        config.check_region(rows, columns)
        return compiled_search(pixels, rows, columns, config, meter)
    search, answer = search_stars(rows, columns, config, meter), None
    while True:
        try:
            access = search.send(answer)
        except StopIteration as done:
            detection: Detection = done.value
            return detection
        match access:
            case Look():
                answer = _look(pixels, access)
                meter.charge(ebi_read=len(answer))
            case Put():
                pixels[access.offsets] = access.values
                meter.charge(ebi_write=len(access.offsets))


def _look(pixels: NDArray[np.uint8], access: Look) -> NDArray[np.uint8]:
    if _LOOK:
        values = np.empty(len(access.offsets), np.uint8)
        return values[: _LOOK(pixels, access.offsets, len(values), access.above, values)]
    values = pixels[access.offsets]
    above = np.flatnonzero(values > access.above)
    return values[: above[0] + 1] if len(above) else values


def search_stars(rows: int, columns: int, config: DetectionConfig, meter: Meter) -> Search:
    """Find the stars of an image of ``rows`` by ``columns`` 8-bit values; phases `search` and
    `centroid`. The yielded accesses are not charged. Raises as ``detect_stars`` does."""
    config.check_region(rows, columns)
    search = background_search if config.background else sampled_search
    return search(rows, columns, config, meter)
