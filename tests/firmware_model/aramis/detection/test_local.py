"""Levels of the sky place by place."""

import numpy as np
import pytest

from cubestack.firmware_model.aramis.detection.local import BLOCK, interpolated, measure_sky

from ..sky import FIELD, meter

ROWS, COLUMNS = FIELD.rows, FIELD.columns


def noisy(level: object, noise: float = 3.0, seed: int = 0) -> np.ndarray:
    image = np.random.default_rng(seed).normal(0, noise, (ROWS, COLUMNS)) + level
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("level", [20, 200])
@pytest.mark.parametrize("noise", [2.0, 6.0])
def test_level_and_noise(level: int, noise: float) -> None:
    sky = measure_sky(noisy(level, noise), FIELD, meter())
    assert sky.level == pytest.approx(level, abs=1)
    assert sky.deviation == pytest.approx(noise, rel=0.06)


def test_hot_pixels_and_stars_move_neither() -> None:
    image = noisy(20)
    image.ravel()[np.random.default_rng(1).choice(image.size, 20_000, replace=False)] = 255
    image[500:510, 600:610] = 255
    sky = measure_sky(image, FIELD, meter())
    assert sky.level == pytest.approx(20, abs=1)
    assert sky.deviation == pytest.approx(3, rel=0.15)


def test_a_gradient_is_followed() -> None:
    y, x = np.mgrid[:ROWS, :COLUMNS]
    true = 10 + 0.05 * x + 0.03 * y
    sky = measure_sky(noisy(true), FIELD, meter())
    found = interpolated(sky.levels, (ROWS, COLUMNS)).astype(float)
    inner = np.s_[BLOCK:-BLOCK, BLOCK:-BLOCK]
    assert np.abs(found - true)[inner].max() < 2.5
    assert sky.spread == pytest.approx(48, abs=4)  # nine tenths of the round field


def test_half_a_picture_that_is_full_blinds_half_of_the_field() -> None:
    image = noisy(5)
    image[:512] = 255
    sky = measure_sky(image, FIELD, meter())
    assert sky.blind == pytest.approx(0.5, abs=0.03)


def test_between_blocks_levels_are_interpolated() -> None:
    blocks = np.array([[0.0, 64.0], [0.0, 64.0]], np.float32)
    (row, *others) = interpolated(blocks, (2 * BLOCK, 2 * BLOCK))
    assert (row[: BLOCK // 2] == 0).all()
    assert (row[-BLOCK // 2 :] == 64).all()
    assert (np.diff(row.astype(int))[BLOCK // 2 : -BLOCK // 2] == 2).all()
    assert all((other == row).all() for other in others)
    assert interpolated(blocks + 1000, (64, 64)).min() == 255
