import struct

import numpy as np
import pytest

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.memory import CAPACITY, budget
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.memory import Buffer, Memory, used

PROGRAM_RAM = 32 * 1024
"""Left for what the model does not have: library data, other peripherals' buffers."""


@pytest.fixture(scope="module")
def buffers(catalogue: StarCatalogue) -> tuple[Buffer, ...]:
    return budget(catalogue)


def size(buffers: tuple[Buffer, ...], name: str) -> int:
    """Size of the buffer ``name`` in bytes; it must be the only one."""
    (found,) = [buffer.size for buffer in buffers if buffer.name == name]
    return found


@pytest.mark.parametrize("memory", Memory)
def test_everything_fits(buffers: tuple[Buffer, ...], memory: Memory) -> None:
    spare = PROGRAM_RAM if memory is Memory.RAM else 0
    assert 0 < used(buffers)[memory] <= CAPACITY[memory] - spare


def test_the_part() -> None:
    kilobytes = {memory.name: size / 1024 for memory, size in CAPACITY.items()}
    assert kilobytes == {"RAM": 128, "FLASH": 1024, "EXTERNAL_RAM": 1024, "RETENTION": 0.5}


def test_every_byte_is_counted_once(buffers: tuple[Buffer, ...]) -> None:
    assert sum(used(buffers).values()) == sum(buffer.size for buffer in buffers)
    assert all(buffer.size > 0 for buffer in buffers)
    assert len({(buffer.name, buffer.memory) for buffer in buffers}) == len(buffers)


def test_the_catalogue_s_size(buffers: tuple[Buffer, ...], catalogue: StarCatalogue) -> None:
    listed = size(buffers, "star list") + size(buffers, "pair list")
    assert listed == len(catalogue.to_bytes())


def test_sizes_that_other_sources_give(buffers: tuple[Buffer, ...]) -> None:
    assert size(buffers, "image") == IMAGE_BYTES
    retained = [buffer.size for buffer in buffers if buffer.memory is Memory.RETENTION]
    assert retained == [State.RETENTION_SIZE]
    # Section 4.3: 190 pairs of 20 stars; votes of each star for each of 405.
    assert size(buffers, "pairs of stars") == 190 * 8
    assert size(buffers, "votes") == 2 * 20 * 405


def test_visited_pixels_fit_at_the_limits_of_all_settings(buffers: tuple[Buffer, ...]) -> None:
    # 20 stars and 51 invalid areas of 100 pixels, 256 noise areas of 99, four bytes each
    assert size(buffers, "visited pixels") == 4 * (71 * 100 + 256 * 99)


def test_stars_beyond_the_published_list_are_kept_whole(buffers: tuple[Buffer, ...]) -> None:
    # 20 more: centroid, undistorted point, vector; size, intensity. The expected error of all 40.
    more = 20 * struct.calcsize("<2f 2f 3f B H") + 40 * struct.calcsize("<f")
    assert size(buffers, "stars beyond the published list") == more


def test_the_reduced_list_s_size(buffers: tuple[Buffer, ...], catalogue: StarCatalogue) -> None:
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(200, 3)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    meter = Meter(CORTEX_M3)
    sizes = [8 * len(catalogue.reduced(each, 35.0, meter)[1]) for each in directions]
    assert max(sizes) <= 1.05 * size(buffers, "reduced pair list")
