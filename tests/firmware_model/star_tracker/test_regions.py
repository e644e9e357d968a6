"""Connected regions against a labelling of whole pictures, and moments against plain sums."""

import numpy as np
import pytest
from scipy import ndimage

from cubestack.firmware_model.star_tracker.regions import Moments, Runs
from tests.together import together


@together("seed", range(30))
def test_touching_runs_form_one_region_with_its_moments(seed: int) -> None:
    rng = np.random.default_rng(seed)
    height, width = (int(size) for size in rng.integers(2, 60, 2))
    mask = rng.random((height, width)) < rng.uniform(0.05, 0.9)
    mask[:, -1] = False
    mask[0, 0] = True
    runs = Runs.of(mask)
    labels, touching = runs.join(width)
    expected, count = ndimage.label(mask, np.ones((3, 3)))
    assert np.array_equal(expected.reshape(-1)[runs.begins] - 1, labels)
    assert touching >= len(runs) - count
    pixels = runs.places()
    assert np.array_equal(pixels, np.flatnonzero(mask))
    rows, columns = np.divmod(pixels, width)
    owners = np.repeat(labels, runs.lengths)
    weights = rng.integers(1, 4000, len(pixels))
    corners = np.zeros(count, np.int64), np.zeros(count, np.int64)
    found = Moments.of(owners, weights, rows, columns, corners)
    for region in range(count):
        own = owners == region
        x, y, w = columns[own], rows[own], weights[own]
        assert found.light[region] == w.sum()
        middle = np.average(x, weights=w), np.average(y, weights=w)
        assert (found.x[region], found.y[region]) == pytest.approx(middle)
        spread = np.cov(x, y, aweights=w, ddof=0) if len(y) > 1 else np.zeros((2, 2))
        moments = found.xx[region], found.yy[region], found.xy[region]
        assert moments == pytest.approx((spread[0, 0], spread[1, 1], spread[0, 1]), abs=1e-6)
        across, along = np.linalg.eigvalsh(spread)
        assert found.along[region] == pytest.approx(along, abs=1e-6)
        assert found.across[region] == pytest.approx(across, abs=1e-6)


def test_pixels_can_be_removed_from_runs() -> None:
    mask = np.zeros((3, 20), np.bool_)
    mask[1, 2:9] = mask[2, 4] = True
    left = Runs.of(mask).without(np.array([22, 25, 26, 44]))
    assert list(zip(left.begins.tolist(), left.ends.tolist(), strict=True)) == [(23, 25), (27, 29)]


def test_no_pixels_have_no_regions() -> None:
    runs = Runs.of(np.zeros((3, 4), np.bool_))
    labels, touching = runs.join(4)
    assert (len(labels), touching, len(runs.places())) == (0, 0, 0)
