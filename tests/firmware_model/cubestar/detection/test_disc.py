"""The Moon's disc: round saturated areas among stars."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection.disc import LARGEST_PX, SeenDisc, find_disc
from cubestack.firmware_model.cubestar.image_memory import ImageMemory
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter

ROWS, COLUMNS = 512, 1024


def found(picture: NDArray[np.uint8], meter: Meter | None = None) -> SeenDisc | None:
    def sample(offsets: NDArray[np.int32]) -> Any:
        yield from ()
        return picture.reshape(-1)[offsets]

    memory = cast(ImageMemory, SimpleNamespace(sample=sample))
    with pytest.raises(StopIteration) as ended:
        next(find_disc(memory, meter or Meter(CORTEX_M3)))
    disc: SeenDisc | None = ended.value.value
    return disc


def sky(*discs: tuple[float, float, float]) -> NDArray[np.uint8]:
    """A dark picture with twenty saturated stars, and discs of x, y and radius in px."""
    picture = np.full((ROWS, COLUMNS), 3, np.uint8)
    rng = np.random.default_rng(1)
    for x, y in rng.integers([8, 8], [COLUMNS - 8, ROWS - 8], (3, 2)):
        picture[y : y + 3, x : x + 2] = 255
    y, x = np.mgrid[:ROWS, :COLUMNS]
    for left, top, radius in discs:
        picture[np.hypot(x - left, y - top) <= radius] = 255
    return picture


@pytest.mark.parametrize("radius", [5.6, 7.0, 12.0, 39.0])
def test_disc_is_found_with_middle_and_radius(radius: float) -> None:
    """From a twentieth lit to full: 100 to 4800 saturated pixels."""
    rng = np.random.default_rng(2)
    for x, y in rng.uniform([60, 60], [960, 450], (20, 2)):
        disc = found(sky((x, y, radius)))
        assert disc is not None
        assert disc.is_whole
        assert np.hypot(disc.x - x, disc.y - y) < 3
        assert disc.radius_px == pytest.approx(radius, abs=2.5)


def test_stars_alone_are_no_disc() -> None:
    assert found(sky()) is None


def test_limb_and_two_lights_are_no_disc() -> None:
    limb = sky()
    limb[400:] = 255
    assert found(limb) is None
    assert found(sky((200, 200, 10), (800, 300, 10))) is None


def test_disc_at_the_edge_is_not_whole() -> None:
    disc = found(sky((5, 200, 20)))
    assert disc is not None
    assert not disc.is_whole
    assert disc.x < LARGEST_PX


def test_each_sample_is_charged() -> None:
    meter = Meter(CORTEX_M3)
    found(sky((300, 300, 10)), meter)
    assert meter.counts["i32_add"] >= ROWS * COLUMNS // 16
