import numpy as np
import pytest

from cubestack.firmware_model.aramis.detection.mask import FRAMES, LevelHistory
from cubestack.firmware_model.aramis.field import CameraField

from ..sky import meter

FLAT = CameraField(columns=64, rows=48, round=False)
ROUND = CameraField(columns=64, rows=48)


def noise(level: float, sigma: float, seed: int) -> np.ndarray:
    values = np.random.default_rng(seed).normal(level, sigma, (48, 64))
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def after(*pictures: np.ndarray, field: CameraField = FLAT) -> LevelHistory:
    background = LevelHistory()
    for picture in pictures:
        background.add(picture, field, meter())
    return background


def test_mean_plus_two_sigma_of_all_pixels() -> None:
    pictures = [noise(20, 3, seed) for seed in range(FRAMES)]
    background = after(*pictures)
    pixels = np.stack(pictures)
    assert background.mean(meter()) == round(pixels.mean())
    assert background.threshold(2, meter()) == int(pixels.mean() + 2 * pixels.std())
    assert background.threshold(0, meter()) == int(pixels.mean())


def test_only_the_last_five_count() -> None:
    levels = (200, 200, 10, 10, 10, 10, 10)
    background = after(*(np.full((48, 64), level, dtype=np.uint8) for level in levels))
    assert len(background.sums) == FRAMES
    assert background.mean(meter()) == background.threshold(2, meter()) == 10


def test_background_works_with_fewer_images() -> None:
    assert LevelHistory().mean(meter()) == LevelHistory().threshold(2, meter()) == 0
    assert after(noise(50, 5, 1)).threshold(2, meter()) == pytest.approx(60, abs=1)


def test_a_change_of_level_is_followed_slowly() -> None:
    assert after(*[noise(20, 2, 1)] * 4, noise(40, 2, 2)).mean(meter()) == 24


def test_what_is_outside_the_field_does_not_count() -> None:
    background = after(np.where(ROUND.mask, 30, 255).astype(np.uint8), field=ROUND)
    assert background.mean(meter()) == background.threshold(5, meter()) == 30


def test_the_largest_sums() -> None:
    """All white at full size: the squares of five pictures exceed 32 bits."""
    white = np.full((1024, 1280), 255, dtype=np.uint8)
    background = after(*[white] * FRAMES, field=CameraField(round=False))
    assert background.sums[0][2] < 2**39
    assert background.threshold(2, meter()) == 255
