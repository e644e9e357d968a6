"""Connected areas against a labelling of whole pictures, and their sums against plain ones."""

import numpy as np
import pytest
from scipy import ndimage

from cubestack.firmware_model.cubestar.detection import areas


@pytest.mark.parametrize("seed", range(30))
def test_runs_that_touch_are_one_area_with_the_sums_of_its_pixels(seed: int) -> None:
    rng = np.random.default_rng(seed)
    height, width = (int(size) for size in rng.integers(5, 60, 2))
    mask = rng.random((height, width)) < rng.uniform(0.05, 0.7)
    mask[:, -1] = False
    mask[0, 0] = True
    signal = rng.integers(1, 4000, (height, width))
    runs = areas.runs_of(mask)
    labels = areas.join(runs, width)
    expected, count = ndimage.label(mask, np.ones((3, 3)))
    assert np.array_equal(expected.reshape(-1)[runs.begins] - 1, labels)
    assert np.all(runs.short) == bool((runs.ends - runs.begins).max() <= areas.LONGEST_RUN)
    found = areas.measure(runs, labels, signal.reshape(-1)[runs.places()], width)
    for area in np.flatnonzero(~found.large):
        y, x = np.nonzero(expected == area + 1)
        weights = signal[y, x]
        assert (found.sizes[area], found.light[area]) == (len(y), weights.sum())
        assert found.tops[area] == weights.max() == signal.reshape(-1)[found.peaks[area]]
        middle = np.average(x, weights=weights), np.average(y, weights=weights)
        assert found.middles[area] == pytest.approx(middle)
        spread = np.cov(x, y, aweights=weights, ddof=0) if len(y) > 1 else np.zeros((2, 2))
        moments = spread[0, 0], spread[1, 1], spread[0, 1]
        assert found.moments[area] == pytest.approx(moments, abs=1e-6)
    assert len(found.sizes) == count


def test_a_long_run_makes_its_area_large() -> None:
    mask = np.zeros((8, 100), np.bool_)
    mask[2, 3 : 3 + areas.LONGEST_RUN] = True
    mask[5, 3 : 4 + areas.LONGEST_RUN] = True
    mask[6, 20] = True
    runs = areas.runs_of(mask)
    found = areas.measure(runs, areas.join(runs, 100), np.full(areas.LONGEST_RUN + 1, 5), 100)
    assert found.large.tolist() == [False, True]
    assert found.sizes.tolist() == [areas.LONGEST_RUN, 1]


def test_where_all_runs_are_long_the_places_are_in_the_areas() -> None:
    mask = np.zeros((8, 100), np.bool_)
    mask[2, 3:90] = mask[5:7, 20:80] = True
    runs = areas.runs_of(mask)
    found = areas.measure(runs, areas.join(runs, 100), np.empty(0, np.int64), 100)
    assert found.large.tolist() == [True, True]
    labels, _ = ndimage.label(mask)
    assert labels.reshape(-1)[found.peaks].tolist() == [1, 2]


def test_runs_lose_their_spikes() -> None:
    mask = np.zeros((3, 20), np.bool_)
    mask[1, 2:9] = mask[2, 4] = True
    left = areas.without(areas.runs_of(mask), np.array([22, 25, 26, 44]))
    assert list(zip(left.begins.tolist(), left.ends.tolist(), strict=True)) == [(23, 25), (27, 29)]


@pytest.mark.parametrize(
    ("beside", "sharp"), [((0, 0, 0, 0), True), ((15, 15, 10, 10), True), ((20, 20, 20, 20), False)]
)
def test_a_spike_stands_alone(beside: tuple[int, int, int, int], sharp: bool) -> None:
    picture = np.full((5, 5), 7, np.uint8)
    picture[2, 2] += 100
    for (dy, dx), value in zip(((-1, 0), (1, 0), (0, -1), (0, 1)), beside, strict=True):
        picture[2 + dy, 2 + dx] += value
    level, noise = np.array([7 * 16]), np.array([5])
    found = areas.spikes(picture.reshape(-1), np.array([12]), 5, level, noise)
    assert found.tolist() == [sharp]
