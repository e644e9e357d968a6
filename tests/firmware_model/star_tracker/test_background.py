"""Level and noise of the sky: planes are met exactly, and neither stars nor gradients disturb."""

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.star_tracker.background import (
    CELL,
    UNIT,
    SkyBackground,
    cell_middles,
    estimate,
    sample_offsets,
)
from tests.together import together

SHAPE = 512, 1024
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]]

BOTH = pytest.mark.parametrize(("step", "smooth"), [(4, False), (2, True)])
"""CubeStar's samples, and AraMiS' smoothed ones."""


def taken(image: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.clip(np.floor(image), 0, 255).astype(np.uint8)


def of(picture: NDArray[np.uint8], step: int = 4, smooth: bool = False) -> SkyBackground:
    down, across = sample_offsets(*picture.shape, step)
    sky = estimate(picture[np.ix_(down, across)], step)
    return sky.smoothed() if smooth else sky


def test_background_interpolates_and_extrapolates_a_plane() -> None:
    plane = (3 * X + 7 * Y) * UNIT // 8
    cells = plane[16::32, 16::32]
    sky = SkyBackground(cells, cells)
    assert np.abs(sky.interpolated(sky.levels, Y, X) - plane).max() <= 2


@BOTH
@together("sigma", [0.7, 1.5, 4.0, 9.0])
@together("slope", [0.0, 60.0])
def test_background_level_and_noise_are_measured_despite_stars(
    sigma: float, slope: float, step: int, smooth: bool
) -> None:
    rng = np.random.default_rng(4)
    ramp = slope * np.arange(512)[:, None] / 512
    image = 40.5 + ramp + rng.normal(0, sigma, SHAPE)
    image.ravel()[rng.choice(image.size, 10_000, replace=False)] = 255  # hot pixels
    for x, y in rng.integers(20, 490, (150, 2)):
        near = np.s_[y - 6 : y + 7, x - 6 : x + 7]
        image[near] += 80 * np.exp(-((X[near] - x) ** 2 + (Y[near] - y) ** 2) / 4)
    sky = of(taken(image), step, smooth)
    truth = np.broadcast_to(40 + ramp[16::32], sky.levels.shape)
    inner = np.s_[1:-1] if smooth else np.s_[:]  # smoothing flattens the border
    apart = (sky.levels / UNIT - truth)[inner]
    assert np.abs(apart).mean() < 0.25 * sigma + 0.05
    assert np.abs(apart.mean()) < 0.05 * sigma + 0.1
    assert np.median(sky.noises) / UNIT == pytest.approx(np.hypot(sigma, 0.29), rel=0.1)


@BOTH
def test_background_of_a_bright_half_is_the_bright_level(step: int, smooth: bool) -> None:
    picture = np.zeros(SHAPE, np.uint8)
    picture[:, 512:] = 255
    sky = of(picture, step, smooth)
    assert sky.saturated == 0.5
    assert np.array_equal(np.unique(sky.levels), [0, 255 * UNIT])


def test_smoothing_removes_a_spot_that_fills_a_background_cell() -> None:
    picture = np.full((160, 160), 9, np.uint8)
    picture[64:96, 64:96] = 200
    assert of(picture).levels[2, 2] == 200 * UNIT
    assert np.all(of(picture, smooth=True).levels == 9 * UNIT)


@pytest.mark.parametrize("shape", [(20, 20), (32, 33), (100, 41)])
@pytest.mark.parametrize("step", [2, 4])
def test_background_cells_cover_any_region_size(shape: tuple[int, int], step: int) -> None:
    down, across = sample_offsets(*shape, step)
    assert (down.max(), across.max()) < (shape[0], shape[1])
    sky = of(np.full(shape, 9, np.uint8), step)
    assert min(sky.levels.shape) >= 2
    assert sky.levels.shape == tuple(len(cell_middles(size)) for size in shape)
    y, x = np.mgrid[: shape[0], : shape[1]]
    assert np.all(sky.interpolated(sky.levels, y, x) == 9 * UNIT)


def test_brighter_pixels_exceed_both_noise_and_minimum_difference() -> None:
    cells = np.full((4, 4), 10 * UNIT)
    sky = SkyBackground(cells, np.full((4, 4), 2 * UNIT))
    picture = np.full((4 * CELL, 4 * CELL), 18, np.uint8)
    picture[50, 60:63] = 19, 25, 26
    assert np.argwhere(sky.brighter(picture, 4)).tolist() == [[50, 60], [50, 61], [50, 62]]
    assert np.argwhere(sky.brighter(picture, 4, 15 * UNIT)).tolist() == [[50, 62]]
