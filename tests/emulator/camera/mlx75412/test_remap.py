from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.camera.mlx75412.imager import ELECTRONS_PER_DN12, IDEAL
from cubestack.emulator.camera.mlx75412.remap import DEPTH, Remap, remapped, table
from cubestack.emulator.light.pixels import grey_values

REMAPS = (Remap.STRETCHED, Remap.EQUALIZED)


def frame(seed: int) -> np.ndarray:
    """Noise about 40 counts of 12 bits, and a few hundred bright pixels."""
    rng = np.random.default_rng(seed)
    values = rng.normal(40, 6, (64, 256))
    values.flat[rng.integers(values.size, size=300)] = rng.uniform(60, 4000, 300)
    return (values * ELECTRONS_PER_DN12).astype(np.float32)


@pytest.mark.parametrize("remap", Remap)
def test_brighter_pixels_are_never_darker(remap: Remap) -> None:
    light = frame(1)
    grey = remapped(light, IDEAL, remap)
    order = np.argsort(np.round(light / ELECTRONS_PER_DN12).clip(0, DEPTH - 1), axis=None)
    assert (np.diff(grey.ravel()[order].astype(int)) >= 0).all()


def test_upper_bits_are_those_without_a_remap() -> None:
    light = frame(2)
    np.testing.assert_array_equal(
        remapped(light, IDEAL, Remap.UPPER_BITS), grey_values(light, IDEAL)
    )


def test_stretch_covers_the_range_in_proportion() -> None:
    histogram = np.zeros(DEPTH, np.int64)
    histogram[[100, 500, 900]] = 5
    found = table(histogram, Remap.STRETCHED)
    assert [*found[[0, 100, 500, 900, 4095]]] == [0, 0, 127, 255, 255]


def test_equal_numbers_of_pixels_get_equal_ranges() -> None:
    histogram = np.zeros(DEPTH, np.int64)
    histogram[1000:1256] = 7
    np.testing.assert_array_equal(table(histogram, Remap.EQUALIZED)[1000:1256], np.arange(256))
    skewed = histogram.copy()
    skewed[1000] = 7 * 255  # half of all: the others share the upper half
    assert table(skewed, Remap.EQUALIZED)[1001] >= 127


@pytest.mark.parametrize("remap", REMAPS)
def test_frame_of_one_value_is_black(remap: Remap) -> None:
    assert not remapped(np.full((4, 4), 50, np.float32), IDEAL, remap).any()


def test_remap_of_noise_leaves_no_meaning_to_a_small_threshold() -> None:
    """Of a dark frame, equalized, nearly all pixels are above 6; stretched, the bright ones."""
    light = frame(3)
    above = {one: np.mean(remapped(light, IDEAL, one) > 6) for one in REMAPS}
    assert above[Remap.EQUALIZED] > 0.9
    assert above[Remap.STRETCHED] < 0.05


def test_dark_values_keep_12_bits() -> None:
    counts = np.arange(250, dtype=np.float32)[None] * np.float32(ELECTRONS_PER_DN12)
    assert len(np.unique(remapped(counts, IDEAL, Remap.EQUALIZED))) == 250
    coarse = replace(IDEAL, step=1.0, full_scale=255)
    np.testing.assert_array_equal(grey_values(counts, coarse)[0], np.arange(250))
