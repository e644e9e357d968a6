"""Centroids of regions against sums over each region."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from cubestack.firmware_model.aramis.detection.regions import MOST_RUNS, find_regions, locate_stars
from cubestack.firmware_model.aramis.solution import StarList

TOUCHING = np.ones((3, 3))


def stars(picture: NDArray[np.uint8], mask: NDArray[np.bool_], **limits: int) -> StarList:
    settings = {"floor": 0, "min_pixels": 1, "max_pixels": 10_000, **limits}
    regions = find_regions(mask)
    assert regions is not None
    return locate_stars(picture, regions, **settings)


@pytest.mark.parametrize("floor", [0, 20])
@pytest.mark.parametrize("seed", range(10))
def test_centroids_are_weighted_means(seed: int, floor: int) -> None:
    rng = np.random.default_rng(seed)
    picture = rng.integers(0, 256, (40, 50)).astype(np.uint8)
    mask = ndimage.binary_dilation(rng.random((40, 50)) < 0.02)
    found = stars(picture, mask, floor=floor)
    labels, count = ndimage.label(mask, TOUCHING)
    weight = np.maximum(picture.astype(float) - floor, 0)
    total = ndimage.sum_labels(weight, labels, np.arange(1, count + 1))
    middle = np.array(ndimage.center_of_mass(weight, labels, np.arange(1, count + 1)))
    order = np.argsort(-total, kind="stable")
    order = order[total[order] > 0]
    np.testing.assert_array_equal(found.brightness, total[order])
    np.testing.assert_allclose(found.centroids, middle[order][:, ::-1], atol=1e-4)


def test_sizes_out_of_range_are_no_stars() -> None:
    mask = np.zeros((20, 20), dtype=bool)
    mask[2, 2] = mask[5:8, 5:8] = mask[12:18, 10:18] = True
    picture = np.full((20, 20), 100, dtype=np.uint8)
    assert len(stars(picture, mask)) == 3
    assert stars(picture, mask, min_pixels=2, max_pixels=20).centroids.tolist() == [[6, 6]]


def test_a_gaussian_spot_is_found_to_a_hundredth_of_a_pixel() -> None:
    y, x = np.mgrid[:40, :40]
    for centre_x, centre_y in ((19.3, 20.8), (20.5, 18.25)):
        spot = 200 * np.exp(-((x - centre_x) ** 2 + (y - centre_y) ** 2) / (2 * 2.0**2))
        picture = np.rint(spot + 14).astype(np.uint8)
        found = stars(picture, picture > 15, floor=14)
        np.testing.assert_allclose(found.centroids, [[centre_x, centre_y]], atol=0.01)


def test_nothing() -> None:
    picture = np.zeros((8, 8), dtype=np.uint8)
    assert len(stars(picture, picture > 0)) == 0
    assert len(stars(picture, picture == 0)) == 0  # lit, but without weight


def test_the_whole_picture_is_one_region() -> None:
    picture = np.full((1024, 1280), 255, dtype=np.uint8)
    found = stars(picture, picture > 0, max_pixels=1280 * 1024)
    np.testing.assert_allclose(found.centroids, [[639.5, 511.5]], atol=1e-3)


def test_gives_up_on_too_many_runs() -> None:
    chequered = (np.indices((256, 256)).sum(axis=0) % 2).astype(bool)
    assert chequered.sum() > MOST_RUNS
    assert find_regions(chequered) is None
