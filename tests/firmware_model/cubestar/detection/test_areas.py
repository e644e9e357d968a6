"""Areas of a picture: their brightest pixels, runs too long for a spot, and spikes."""

import numpy as np
import pytest
from scipy import ndimage

from cubestack.firmware_model.cubestar.detection import areas
from cubestack.firmware_model.star_tracker.regions import Runs


@pytest.mark.parametrize("seed", range(10))
def test_areas_report_size_and_brightest_pixel(seed: int) -> None:
    rng = np.random.default_rng(seed)
    height, width = (int(size) for size in rng.integers(5, 60, 2))
    mask = rng.random((height, width)) < rng.uniform(0.05, 0.7)
    mask[:, -1] = False
    signal = rng.integers(1, 4000, (height, width))
    runs = Runs.of(mask)
    found = areas.measure(runs, signal[mask], width)
    expected, count = ndimage.label(mask, np.ones((3, 3)))
    assert len(found.sizes) == count
    assert found.large.any() == (runs.lengths.max() > areas.LONGEST_RUN)
    for area in range(count):
        own = signal[expected == area + 1]
        assert (found.sizes[area], found.moments.light[area]) == (len(own), own.sum())
        assert found.tops[area] == own.max() == signal.reshape(-1)[found.peaks[area]]


def test_run_longer_than_the_limit_marks_its_area_as_large() -> None:
    mask = np.zeros((8, 100), np.bool_)
    mask[2, 3 : 3 + areas.LONGEST_RUN] = True
    mask[5, 3 : 4 + areas.LONGEST_RUN] = True
    mask[6, 20] = True
    runs = Runs.of(mask)
    found = areas.measure(runs, np.full(areas.LONGEST_RUN + 1, 5), 100)
    assert found.large.tolist() == [False, True]
    assert found.sizes.tolist() == [areas.LONGEST_RUN, 1]


def test_peaks_of_areas_with_only_long_runs_are_inside_them() -> None:
    mask = np.zeros((8, 100), np.bool_)
    mask[2, 3:90] = mask[5:7, 20:80] = True
    runs = Runs.of(mask)
    found = areas.measure(runs, np.empty(0, np.int64), 100)
    assert found.large.tolist() == [True, True]
    labels, _ = ndimage.label(mask)
    assert labels.reshape(-1)[found.peaks].tolist() == [1, 2]


@pytest.mark.parametrize(
    ("beside", "sharp"), [((0, 0, 0, 0), True), ((15, 15, 10, 10), True), ((20, 20, 20, 20), False)]
)
def test_bright_pixel_is_a_spike_only_without_bright_neighbours(
    beside: tuple[int, int, int, int], sharp: bool
) -> None:
    picture = np.full((5, 5), 7, np.uint8)
    picture[2, 2] += 100
    for (dy, dx), value in zip(((-1, 0), (1, 0), (0, -1), (0, 1)), beside, strict=True):
        picture[2 + dy, 2 + dx] += value
    level, noise = np.array([7 * 16]), np.array([5])
    found = areas.spikes(picture.reshape(-1), np.array([12]), 5, level, noise)
    assert found.tolist() == [sharp]
