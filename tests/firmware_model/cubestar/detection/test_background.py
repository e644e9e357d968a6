"""Level and noise of the sky: planes are met exactly, and neither stars nor gradients disturb."""

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection.background import (
    UNIT,
    Background,
    estimate,
    sample_offsets,
)

from ..sky import meter
from .pictures import spots, taken


def of(picture: NDArray[np.uint8]) -> Background:
    down, across = sample_offsets(*picture.shape)
    return estimate(picture[np.ix_(down, across)], meter())


def test_a_plane_is_interpolated_and_continued() -> None:
    y, x = np.mgrid[:512, :1024]
    plane = (3 * x + 7 * y) * UNIT // 8
    cells = plane[16::32, 16::32]
    sky = Background(cells, cells, 0.0)
    assert np.abs(sky.interpolated(sky.levels, y, x) - plane).max() <= 2


@pytest.mark.parametrize("sigma", [0.7, 1.5, 4.0, 9.0])
@pytest.mark.parametrize("slope", [0.0, 60.0])
def test_level_and_noise_of_a_noisy_sky(sigma: float, slope: float) -> None:
    rng = np.random.default_rng(4)
    ramp = slope * np.arange(512)[:, None] / 512
    stars = spots(rng.uniform(20, 500, (150, 2)), rng.uniform(50, 5000, 150))
    sky = of(taken(40.5 + ramp + stars + rng.normal(0, sigma, (512, 1024))))
    truth = 40 + ramp[16::32]
    assert np.abs(sky.levels / UNIT - truth).mean() < 0.25 * sigma
    assert np.abs((sky.levels / UNIT - truth).mean()) < 0.05 * sigma + 0.1
    assert np.median(sky.noises) / UNIT == pytest.approx(np.hypot(sigma, 0.29), rel=0.1)


def test_a_bright_area_is_its_own_background() -> None:
    picture = np.zeros((512, 1024), np.uint8)
    picture[:, 512:] = 255
    sky = of(picture)
    assert sky.saturated == 0.5
    assert np.array_equal(np.unique(sky.levels), [0, 255 * UNIT])


@pytest.mark.parametrize("shape", [(20, 20), (32, 33), (100, 41)])
def test_any_region_has_cells_enough(shape: tuple[int, int]) -> None:
    down, across = sample_offsets(*shape)
    assert (down.max(), across.max()) < (shape[0], shape[1])
    sky = of(np.full(shape, 9, np.uint8))
    assert min(sky.levels.shape) >= 2
    y, x = np.mgrid[: shape[0], : shape[1]]
    assert np.all(sky.interpolated(sky.levels, y, x) == 9 * UNIT)
