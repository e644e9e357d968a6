"""Regions against sums over each, and spikes, both ways, against counting window by window."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from cubestack.firmware_model.aramis.detection.charges import charge_spikes
from cubestack.firmware_model.aramis.detection.mask import (
    FRAMES,
    HALF,
    LevelHistory,
    SpikeRemoval,
    remove_spikes,
)
from cubestack.firmware_model.aramis.detection.regions import MOST_RUNS, find_regions, locate_stars
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.solution import StarList
from cubestack.host.studies.aramis.sky import meter
from tests.together import together

TOUCHING = np.ones((3, 3))


def stars(picture: NDArray[np.uint8], mask: NDArray[np.bool_], **limits: int) -> StarList:
    settings = {"floor": 0, "min_pixels": 1, "max_pixels": 10_000, **limits}
    regions = find_regions(mask)
    assert regions is not None
    return locate_stars(picture, regions, **settings)


@together("floor", [0, 20])
@together("seed", range(10))
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


def test_regions_of_size_out_of_range_are_not_stars() -> None:
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


def test_regions_without_light_yield_no_stars() -> None:
    picture = np.zeros((8, 8), dtype=np.uint8)
    assert len(stars(picture, picture > 0)) == 0
    assert len(stars(picture, picture == 0)) == 0  # lit, but without weight


def test_white_image_is_one_region() -> None:
    picture = np.full((1024, 1280), 255, dtype=np.uint8)
    found = stars(picture, picture > 0, max_pixels=1280 * 1024)
    np.testing.assert_allclose(found.centroids, [[639.5, 511.5]], atol=1e-3)


def test_find_regions_returns_none_for_too_many_runs() -> None:
    chequered = (np.indices((256, 256)).sum(axis=0) % 2).astype(bool)
    assert chequered.sum() > MOST_RUNS
    assert find_regions(chequered) is None


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


def test_background_threshold_is_mean_plus_sigmas_of_all_pixels() -> None:
    pictures = [noise(20, 3, seed) for seed in range(FRAMES)]
    background = after(*pictures)
    pixels = np.stack(pictures)
    assert background.mean(meter()) == round(pixels.mean())
    assert background.threshold(2, meter()) == int(pixels.mean() + 2 * pixels.std())
    assert background.threshold(0, meter()) == int(pixels.mean())


def test_background_uses_only_the_last_five_images() -> None:
    levels = (200, 200, 10, 10, 10, 10, 10)
    background = after(*(np.full((48, 64), level, dtype=np.uint8) for level in levels))
    assert len(background.sums) == FRAMES
    assert background.mean(meter()) == background.threshold(2, meter()) == 10


def test_background_works_with_fewer_images() -> None:
    assert LevelHistory().mean(meter()) == LevelHistory().threshold(2, meter()) == 0
    assert after(noise(50, 5, 1)).threshold(2, meter()) == pytest.approx(60, abs=1)


def test_background_mean_follows_a_step_slowly() -> None:
    assert after(*[noise(20, 2, 1)] * 4, noise(40, 2, 2)).mean(meter()) == 24


def test_background_ignores_pixels_outside_the_field() -> None:
    background = after(np.where(ROUND.mask, 30, 255).astype(np.uint8), field=ROUND)
    assert background.mean(meter()) == background.threshold(5, meter()) == 30


def test_background_sums_of_white_images_do_not_overflow() -> None:
    """All white at full size: the squares of five pictures exceed 32 bits."""
    white = np.full((1024, 1280), 255, dtype=np.uint8)
    background = after(*[white] * FRAMES, field=CameraField(round=False))
    assert background.sums[0][2] < 2**39
    assert background.threshold(2, meter()) == 255


Mask = NDArray[np.bool_]
SHAPES = [(20, 25), (21, 28), (24, 22), (5, 5), (3, 4), (1, 1)]


def run(mask: Mask, method: SpikeRemoval, needed: int = HALF) -> Mask:
    return remove_spikes(mask, method, needed)[0]


def slowly(mask: Mask, method: SpikeRemoval, needed: int) -> Mask:
    """As section 3.5 says it, one window after the other."""
    rows, columns = mask.shape
    result = np.zeros_like(mask)
    if method is SpikeRemoval.CENTRE:
        for y in range(rows):
            for x in range(columns):
                window = mask[max(0, y - 2) : y + 3, max(0, x - 2) : x + 3]
                result[y, x] = 25 * window.sum() >= needed * window.size
        return result
    for y in range(0, rows, 5):
        for x in range(0, columns, 5):
            window = mask[y : y + 5, x : x + 5]
            if 25 * window.sum() >= needed * window.size:
                result[y : y + 5, x : x + 5] = window
    return result


@together("method", [SpikeRemoval.CENTRE, SpikeRemoval.WINDOW])
@together("shape", SHAPES)
@together("needed", [1, 8, HALF, 25])
def test_spike_filter_equals_a_window_by_window_reference(
    method: SpikeRemoval, shape: tuple[int, int], needed: int
) -> None:
    for seed in range(5):
        mask = np.random.default_rng(seed).random(shape) < 0.5
        np.testing.assert_array_equal(run(mask, method, needed), slowly(mask, method, needed))


@pytest.mark.parametrize("method", [SpikeRemoval.CENTRE, SpikeRemoval.WINDOW])
def test_spike_removal_keeps_stars(method: SpikeRemoval) -> None:
    spikes = np.random.default_rng(1).random((100, 100)) < 0.05
    assert not run(spikes, method).any()
    star = np.zeros((100, 100), dtype=bool)
    star[40:50, 40:50] = True
    assert run(spikes | star, method)[40:50, 40:50].sum() > 90


@pytest.mark.parametrize(
    ("place", "beside", "across"), [(20, 25, 25), (21, 20, 16), (22, 15, 0), (23, 15, 0)]
)
def test_window_method_loses_a_spot_on_the_corner_of_windows(
    place: int, beside: int, across: int
) -> None:
    """5 x 5 pixels off the grid in one direction, then in both."""
    for column, kept in ((20, beside), (place, across)):
        spot = np.zeros((50, 50), dtype=bool)
        spot[place : place + 5, column : column + 5] = True
        assert run(spot, SpikeRemoval.WINDOW).sum() == kept
        assert run(spot, SpikeRemoval.CENTRE)[place + 2, column + 2]


def test_spike_filter_keeps_13_pixels_of_a_window_and_removes_12() -> None:
    mask = np.zeros((15, 15), dtype=bool)
    mask[5:10, 5:10].flat[:13] = True
    assert run(mask, SpikeRemoval.WINDOW).sum() == 13
    mask[5, 5] = False
    assert run(mask, SpikeRemoval.WINDOW).sum() == 0


def test_filter_off_leaves_the_image_unchanged() -> None:
    mask = np.random.default_rng(2).random((9, 9)) < 0.5
    assert run(mask, SpikeRemoval.OFF) is mask


def test_window_spike_method_is_the_cheaper_one() -> None:
    first, second = meter(), meter()
    charge_spikes((100, 100), SpikeRemoval.CENTRE, 0, first)
    charge_spikes((100, 100), SpikeRemoval.WINDOW, 0, second)
    looks = [spent.counts["table_byte"] for spent in (first, second)]
    assert looks == [4 * 100**2, 100**2]
    assert first.total > 4 * second.total
