"""The search above the background: what it finds under hazards, what it says, and what it costs."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import (
    Detection,
    DetectionConfig,
    PictureStatistics,
    SearchEnd,
    detect_stars,
)
from cubestack.firmware_model.mcu.costs import Meter

from ..sky import meter
from .pictures import Picture, Places, drawn, errors, spots, taken

CONFIG = DetectionConfig(background=True)
Image = NDArray[np.float64]
Y, X = np.mgrid[0:512, 0:1024]


def search(picture: Picture, own: Meter | None = None) -> Detection:
    picture.setflags(write=False)
    return detect_stars(picture, CONFIG, own or meter())


def told(found: Detection) -> PictureStatistics:
    assert found.statistics is not None
    return found.statistics


def sky(seed: int, count: int = 18, faintest: float = 300.0) -> tuple[Image, Places]:
    """Stars apart from each other, V 1.9 to 3.8, and their places, brightest first."""
    rng = np.random.default_rng(seed)
    cells = np.array(
        [(40 + 100 * column, 45 + 105 * row) for row in range(5) for column in range(10)]
    )
    places = rng.permutation(cells)[:count] + rng.uniform(-25, 25, (count, 2))
    light = np.sort(faintest * 10 ** (0.4 * rng.uniform(0, 1.9, count)))[::-1]
    return spots(places, light), places


def missing(found: Detection, places: Places, within: float = 0.5) -> int:
    if not len(found.centroids):
        return len(places)
    away = np.hypot(*(places[:, None] - found.centroids[None]).transpose(2, 0, 1))
    return int(np.count_nonzero(away.min(axis=1) > within))


@pytest.mark.parametrize("kind", ["sampled", "integrated"])
@pytest.mark.parametrize("seed", range(3))
def test_stars_without_noise_are_more_accurate_than_published(kind: str, seed: int) -> None:
    image, true = drawn(kind, np.random.default_rng(seed))
    found = search(image)
    assert (len(found.centroids), found.end) == (18, SearchEnd.COMPLETE)
    assert np.abs(errors(found, true)).mean() < 0.012
    assert np.all(np.diff(found.intensities.astype(int)) <= 0)


@pytest.mark.parametrize("level", [1, 20, 90])
def test_constant_background_does_not_shift_centroids(level: int) -> None:
    image, _ = sky(1)
    dark, bright = search(taken(image)), search(taken(image + level))
    away = np.abs(errors(dark, bright.centroids.astype(float)))
    assert away[dark.intensities < 900].max() < 0.01  # the others are cut off by 255
    assert away.max() < 0.1
    assert told(bright).background == pytest.approx(level, abs=0.05)


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5])
def test_background_gradient_shifts_centroids_by_less_than_0_02_px(turn: float) -> None:
    image, places = sky(2)
    ramp = np.cos(turn) * X / 1024 + np.sin(turn) * Y / 512
    found = search(taken(image + 60 * (ramp - ramp.min()) / np.ptp(ramp) + 0.5))
    assert missing(found, places, 0.1) == 0
    assert np.abs(errors(found, places)).mean() < 0.02
    assert told(found).background_range == pytest.approx(60, abs=5)


def test_stars_of_a_rotated_image_are_the_rotated_stars() -> None:
    image, _ = sky(3)
    picture = taken(image + np.random.default_rng(3).normal(10, 1, image.shape))
    one, other = search(picture), search(picture[::-1, ::-1].copy())
    turned = [1023, 511] - other.centroids
    away = np.hypot(*(one.centroids[:, None] - turned[None]).transpose(2, 0, 1)).min(axis=1)
    assert len(turned) == len(one.centroids)
    assert np.sort(away)[-1] < 0.1
    assert np.median(away) < 0.01


def test_brightest_stars_are_kept_wherever_they_are() -> None:
    image, places = sky(4, 50)
    for setting, kept in ((20, 40), (6, 12)):
        found = detect_stars(taken(image), replace(CONFIG, max_stars=setting), meter())
        assert (len(found.centroids), found.end) == (kept, SearchEnd.COMPLETE)
        assert missing(found, places[: kept - 3]) == 0


def test_centroid_errors_in_noise_match_their_sigma() -> None:
    pulls = []
    for seed in range(6):
        image, places = sky(seed)
        noise = np.random.default_rng(seed).normal(20, 4, image.shape)
        found = search(taken(image + noise))
        assert missing(found, places) == 0
        assert len(found.centroids) <= 19
        assert told(found).noise == pytest.approx(4, rel=0.1)
        assert told(found).spikes < 5
        pulls.append(errors(found, places) / found.errors_px[:, None])
    sizes = np.abs(np.concatenate(pulls))
    assert 0.6 < np.mean(sizes < 1) < 0.85
    assert np.mean(sizes < 3) > 0.97


@pytest.mark.parametrize(("sigmas", "fewest", "most"), [(3.0, 0, 2), (4.5, 15, 18)])
def test_areas_are_detected_above_four_sigma(sigmas: float, fewest: int, most: int) -> None:
    image = np.random.default_rng(14).normal(60, 4, (512, 1024))
    _, places = sky(14)
    for x, y in places.astype(int):
        image[y - 3 : y + 4, x - 3 : x + 4] = 60  # no noise here
        image[y - 1 : y + 2, x - 1 : x + 2] = 60 + 4 * sigmas
    # The noise, measured in each cell, is 4 DN and a tenth more or less.
    assert fewest <= len(places) - missing(search(taken(image)), places, 1.0) <= most


def test_hot_pixels_hide_no_bright_star_and_add_few() -> None:
    image, places = sky(5)
    rng = np.random.default_rng(5)
    hot = rng.choice(image.size, 20_000, replace=False)
    image.reshape(-1)[hot] += rng.exponential(36, hot.size)
    found = search(taken(image))
    assert missing(found, places[:15], 1.0) == 0
    assert missing(found, places, 1.0) <= 1
    assert len(found.centroids) <= 30
    assert 12_000 < told(found).spikes < 20_000
    assert found.end is SearchEnd.COMPLETE


def test_short_bright_tracks_are_no_stars() -> None:
    image, places = sky(6)
    rng = np.random.default_rng(6)
    for _ in range(60):
        start, length, turn = rng.uniform(20, 480, 2), rng.uniform(6, 20), rng.uniform(0, np.pi)
        for part in np.linspace(0, length, 40):
            row, column = start + part * np.array([np.sin(turn), np.cos(turn)])
            image[int(row), int(2 * column)] += 12
    found = search(taken(image))
    assert missing(found, places) <= 3  # what a track crosses
    assert told(found).elongated > 10
    assert told(found).aligned < 0.5


def test_recognises_star_streaks_by_their_common_direction() -> None:
    _, places = sky(7)
    steps = np.arange(-5, 6)[:, None, None] * [0.6, 0.8]
    image = spots((places + steps).reshape(-1, 2), np.full(11 * 18, 100.0))
    found = search(taken(image))
    assert len(found.centroids) == 0
    assert told(found).elongated == 18
    assert told(found).aligned > 0.9
    assert told(found).streak_px == pytest.approx(11, abs=3)


# The Moon with its glare saturates 7.9 px and more; a disc of 5 px so near glare is like a star.
@pytest.mark.parametrize("radius", [4.0, 8.0, 20.0, 70.0])
def test_bright_disc_is_rejected_and_the_stars_around_it_are_found(radius: float) -> None:
    image, places = sky(8)
    away = np.hypot(X - 500, Y - 250)
    image += np.where(away < radius, 5000, 300 / (1 + (away / radius) ** 3))
    found = search(taken(image))
    outside = np.hypot(*(places - [500, 250]).T) > 4 * radius + 20
    assert missing(found, places[outside]) == 0
    assert told(found).large + told(found).elongated >= 1
    assert np.hypot(*(found.centroids - [500, 250]).T).min() > radius


def test_stars_are_found_beside_a_saturated_half_image() -> None:
    image, places = sky(9)
    image[:, 500:] = 4000
    found = search(taken(image))
    assert missing(found, places[places[:, 0] < 450]) == 0
    assert np.all(found.centroids[:, 0] < 500)
    assert told(found).saturated == pytest.approx(0.5, abs=0.05)


@cache
def hard_pictures() -> dict[str, Picture]:
    rng = np.random.default_rng(10)
    salt = {f"salt {p}": np.where(rng.random(X.shape) < p, 200, 0) for p in (0.05, 0.2, 0.5)}
    blocks = {f"blocks {d}": ((X % d < 5) & (Y % d < 5)) * 150 for d in (8, 12, 16)}
    pictures = {
        "black": 0 * X,
        "white": 0 * X + 255,
        "chessboard": (X + Y) % 2 * 255,
        "stripes": X // 2 % 2 * 200,
        "grid": ((X % 4 == 0) | (Y % 4 == 0)) * 100,
        "anything": rng.integers(0, 256, X.shape),
        "noise": rng.normal(60, 12, X.shape),
        **salt,
        **blocks,
    }
    return {name: np.clip(image, 0, 255).astype(np.uint8) for name, image in pictures.items()}


@pytest.mark.parametrize("name", list(hard_pictures()))
def test_background_search_stays_within_its_time_limit(name: str) -> None:
    own = meter()
    found = search(hard_pictures()[name], own)
    assert own.table.seconds(own.total) < 0.225
    assert own.phases["search"] + own.phases["centroid"] == own.total
    assert own.counts["ebi_read"] >= 524_288 + 32_768
    assert own.counts["ebi_write"] == 0
    assert len(found.centroids) <= 40
    if name in ("black", "white", "noise", "anything"):
        assert (len(found.centroids), found.end) == (0, SearchEnd.COMPLETE)


def test_search_out_of_time_reports_only_the_upper_rows() -> None:
    image, _ = sky(11)
    image[200:] += np.where(np.random.default_rng(11).random((312, 1024)) < 0.25, 20, 0)
    found = search(taken(image))
    assert found.end is SearchEnd.TIME
    assert len(found.centroids)
    assert found.centroids[:, 1].max() < 300


def test_detection_searches_only_the_configured_region() -> None:
    image, places = sky(12)
    config = replace(CONFIG, x_start=200, x_end=700, y_start=100, y_end=400)
    own = meter()
    found = detect_stars(taken(image), config, own)
    x, y = places.T
    inside = (x > 205) & (x < 695) & (y > 105) & (y < 395)
    assert missing(found, places[inside]) == 0
    assert np.all((found.centroids >= [200, 100]) & (found.centroids < [700, 400]))
    assert own.counts["ebi_read"] < 0.33 * 524_288


@pytest.mark.parametrize("light", [300.0, 900.0])
def test_stars_one_pixel_from_the_border_are_located_exactly(light: float) -> None:
    places = np.array([(300, 1), (1, 250), (700, 510), (1022, 255)], np.float64)
    found = search(taken(spots(places, np.full(4, light))))
    assert len(found.centroids) == 4
    assert np.abs(errors(found, places)).max() < 0.02


def test_faint_stars_fill_only_the_free_places_of_the_list() -> None:
    rng = np.random.default_rng(13)
    bright, places = sky(13, 45, 600.0)
    faint = rng.uniform(20, 490, (30, 2)) * [2, 1]
    image = bright + spots(faint, np.full(30, 40.0))
    assert missing(search(taken(image)), places[:38]) == 0
    alone = search(taken(spots(faint, np.full(30, 40.0)) + 0.5))
    assert len(alone.centroids) >= 20
