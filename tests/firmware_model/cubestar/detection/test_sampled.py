"""The search against a literal transcription of its rules, and its accuracy on drawn stars."""

from collections import Counter
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import (
    Detection,
    DetectionConfig,
    DetectionConfigError,
    SearchEnd,
    detect_stars,
)
from tests.together import together

from ..sky import meter
from .pictures import drawn, errors

Place = tuple[int, int]


class TooLargeError(Exception):
    pass


def literal_grow(
    image: NDArray[np.int64],
    y: int,
    x: int,
    area: list[tuple[int, int, int]],
    config: DetectionConfig,
) -> None:
    if len(area) == config.max_pixels:
        raise TooLargeError
    area.append((y, x, int(image[y, x])))
    image[y, x] = 0
    for ny, nx in ((y, x - 1), (y, x + 1), (y - 1, x), (y + 1, x)):
        inside = 0 <= ny < image.shape[0] and 0 <= nx < image.shape[1]
        if inside and image[ny, nx] > config.star_threshold:
            literal_grow(image, ny, nx, area, config)


def literal_search(picture: NDArray[np.uint8], config: DetectionConfig) -> Detection:
    """The rules of the module docstring, one pixel at a time."""
    image = picture.astype(np.int64)
    threshold = max(config.detection_threshold, config.star_threshold)
    centroids, sizes, sums = [], [], []
    invalid = noise = 0
    background = []
    end = SearchEnd.COMPLETE
    rows = range(config.y_start, config.y_end, config.step)
    for y, x in product(rows, range(config.x_start, config.x_end, config.step)):
        if image[y, x] <= threshold:
            background.append(int(image[y, x]))
            continue
        area: list[tuple[int, int, int]] = []
        try:
            literal_grow(image, y, x, area, config)
        except TooLargeError:
            invalid += 1
        else:
            if len(area) < config.min_pixels:
                noise += 1
            else:
                centroids.append(literal_centroid(area, config))
                sizes.append(len(area))
                sums.append(sum(value for _, _, value in area))
        if len(sizes) == config.max_stars:
            end = SearchEnd.STARS
        elif invalid > config.max_invalid:
            end = SearchEnd.INVALID
        elif noise > config.max_noise:
            end = SearchEnd.NOISE
        if end is not SearchEnd.COMPLETE:
            break
    dark = int(np.floor(np.mean(background) + 0.5)) if background else 0
    return Detection(
        np.array(centroids, dtype=np.float32).reshape(-1, 2),
        np.array(sizes),
        np.array(sums),
        invalid,
        noise,
        dark,
        end,
    )


def literal_centroid(area: list[tuple[int, int, int]], config: DetectionConfig) -> Place:
    peak = max(value for _, _, value in area)
    top = np.array([(y, x) for y, x, value in area if value == peak])
    cy, cx = np.floor(top.mean(axis=0) + 0.5)
    half = config.grid_size // 2
    kept = np.array([p for p in area if abs(p[0] - cy) <= half and abs(p[1] - cx) <= half])
    weights = kept[:, 2] - config.star_threshold
    return (np.average(kept[:, 1], weights=weights), np.average(kept[:, 0], weights=weights))


def same(found: Detection, expected: Detection) -> None:
    np.testing.assert_allclose(found.centroids, expected.centroids, rtol=0, atol=1e-4)
    assert found.sizes.tolist() == expected.sizes.tolist()
    assert found.intensities.tolist() == expected.intensities.tolist()
    assert (found.invalid, found.noise) == (expected.invalid, expected.noise)
    assert (found.dark_value, found.end) == (expected.dark_value, expected.end)


def crowded(rng: np.random.Generator, rows: int, columns: int) -> NDArray[np.uint8]:
    image = rng.integers(0, 9, (rows, columns)).astype(float)
    y, x = np.mgrid[0:rows, 0:columns]
    for _ in range(rng.integers(0, 12)):
        cy, cx = rng.uniform(0, rows), rng.uniform(0, columns)
        width = rng.uniform(0.6, 3)
        image += rng.uniform(5, 300) * np.exp(-((y - cy) ** 2 + (x - cx) ** 2) / (2 * width**2))
    if rng.random() < 0.3:
        image[rng.integers(rows)] += 40
    if rng.random() < 0.3:
        image[:, rng.integers(columns)] += 40
    picture: NDArray[np.uint8] = np.clip(image, 0, 255).astype(np.uint8)
    return picture


@together("seed", range(60))
def test_search_follows_the_literal_rules(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, columns = int(rng.integers(12, 60)), int(rng.integers(12, 60))
    image = crowded(rng, rows, columns)
    image.setflags(write=False)
    x_start, y_start = (int(v) for v in rng.integers(0, 6, 2))
    config = DetectionConfig(
        step=int(rng.integers(1, 5)),
        x_start=x_start, x_end=int(rng.integers(x_start + 4, columns + 1)),
        y_start=y_start, y_end=int(rng.integers(y_start + 4, rows + 1)),
        detection_threshold=int(rng.integers(4, 14)), star_threshold=int(rng.integers(4, 14)),
        min_pixels=int(rng.integers(1, 8)), max_pixels=int(rng.integers(8, 70)),
        grid_size=int(rng.choice([3, 5, 7])),
        max_stars=int(rng.integers(1, 12)), max_invalid=int(rng.integers(0, 8)),
        max_noise=int(rng.choice([2, 20, 255])),
    )  # fmt: skip
    found = detect_stars(image, config, meter())
    same(found, literal_search(image, config))
    assert found.errors_px.shape == (0,)  # this search does not know


def test_random_images_reach_every_end_of_the_search() -> None:
    ends = set()
    for seed in range(40):
        image = crowded(np.random.default_rng(seed), 50, 50)
        for settings in ({}, {"max_stars": 1}, {"max_invalid": 0}, {"max_noise": 0}):
            config = DetectionConfig(
                x_end=50, y_end=50, detection_threshold=10, star_threshold=8, **settings
            )
            ends.add(detect_stars(image, config, meter()).end)
    assert ends == set(SearchEnd) - {SearchEnd.TIME}


@pytest.mark.parametrize("kind", ["sampled", "sampled in 5 x 5", "integrated"])
@pytest.mark.parametrize("seed", range(5))
def test_eighteen_noise_free_stars_are_as_accurate_as_published(kind: str, seed: int) -> None:
    image, true = drawn(kind, np.random.default_rng(seed))
    found = detect_stars(image, DetectionConfig(), meter())
    assert len(found.centroids) == 18
    assert (found.invalid, found.noise, found.end) == (0, 0, SearchEnd.COMPLETE)
    error_x, error_y = np.abs(errors(found, true)).mean(axis=0)
    assert error_x <= 0.0244
    assert error_y <= 0.0427


def test_bright_noisy_background_shifts_centroids_by_less_than_0_15_px() -> None:
    rng = np.random.default_rng(2)
    image, true = drawn("integrated", rng, background=30.0)
    image = np.clip(image + rng.normal(0, 1.5, image.shape), 0, 255).astype(np.uint8)
    config = DetectionConfig(detection_threshold=55, star_threshold=55, min_pixels=4)
    found = detect_stars(image, config, meter())
    assert len(found.centroids) >= 12
    error = errors(found, true)
    assert np.abs(error).mean() < 0.03
    assert np.abs(error).max() < 0.15


def test_a_saturated_star_is_centred_on_its_plateau() -> None:
    image = np.zeros((60, 60), dtype=np.uint8)
    y, x = np.mgrid[0:60, 0:60]
    image[:] = np.clip(1500 * np.exp(-((x - 30.3) ** 2 + (y - 28.8) ** 2) / 2), 0, 255)
    config = DetectionConfig(x_end=60, y_end=60)
    found = detect_stars(image, config, meter())
    assert found.centroids[0] == pytest.approx([30.3, 28.8], abs=0.1)


def test_search_of_a_saturated_image_ends_after_51_invalid_areas() -> None:
    found = detect_stars(np.full((512, 1024), 255, dtype=np.uint8), DetectionConfig(), meter())
    assert (found.invalid, len(found.centroids)) == (51, 0)
    assert found.end is SearchEnd.INVALID


def test_sampled_search_reads_every_ninth_pixel_and_costs_grow_with_stars() -> None:
    rng = np.random.default_rng(3)
    empty, few, many = meter(), meter(), meter()
    detect_stars(np.zeros((512, 1024), dtype=np.uint8), DetectionConfig(), empty)
    assert empty.counts["ebi_read"] == 342 * 171
    assert empty.counts["ebi_write"] == 0
    few_found = detect_stars(drawn("sampled", rng, 6)[0], DetectionConfig(), few)
    many_found = detect_stars(drawn("sampled", rng, 12)[0], DetectionConfig(), many)
    for spent, found in ((few, few_found), (many, many_found)):
        pixels = int(found.sizes.sum())
        assert spent.counts["ebi_write"] == 2 * pixels
        assert spent.counts["ebi_read"] == 342 * 171 + 4 * pixels
        assert spent.phases["search"] + spent.phases["centroid"] == spent.total


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"grid_size": 4}, "grid_size must be odd, not 4"),
        ({"min_pixels": 61}, "max_pixels must be 61 to 255 px, not 60"),
        ({"x_start": 1024}, "x_end must be 1025 to 65535 px, not 1024"),
        ({"y_start": 512}, "y_end must be 513 to 65535 px, not 512"),
    ],
)
def test_rejects_contradictory_settings(settings: dict[str, int], message: str) -> None:
    with pytest.raises(DetectionConfigError, match=message):
        replace(DetectionConfig(), **settings)


def test_rejects_region_beyond_the_image() -> None:
    with pytest.raises(DetectionConfigError, match="y_end must be 0 to 256 px, not 512"):
        detect_stars(np.zeros((256, 1024), dtype=np.uint8), DetectionConfig(), meter())


def growing(areas: int, pixels: int) -> Counter[str]:
    """Charges of the search of a dark image with bars; ``pixels`` is the size of each."""
    image = np.zeros((90, 90), np.uint8)
    for number in range(areas):
        image[9 + 9 * number, 10 : 10 + pixels] = 100
        image[9 + 9 * number, 9] = 0
    own = meter()
    found = detect_stars(image, CHARGED, own)
    assert len(found.centroids) == areas
    return own.counts


#: One sample in each bar, at its fourth pixel.
CHARGED = DetectionConfig(x_start=13, x_end=14, y_start=0, y_end=90, step=9, min_pixels=4)


@pytest.mark.parametrize("pixels", [5, 20])
def test_equal_areas_are_charged_equally(pixels: int) -> None:
    none, one, two, six = (growing(areas, pixels) for areas in (0, 1, 2, 6))
    for name in one | six:
        assert two[name] - none[name] == 2 * (one[name] - none[name])
        assert six[name] - none[name] == 6 * (one[name] - none[name])


def test_each_pixel_of_an_area_is_charged_the_same() -> None:
    """Two calls; four neighbours looked at, a turn each; one into the list of pixels and one out
    of it; two for the centroid: the brightest pixel, then the sums."""
    short, longer, longest = (growing(1, pixels) for pixels in (8, 9, 48))
    assert longer["call"] - short["call"] == 2
    assert longest["call"] - short["call"] == 2 * 40
    assert longer["loop"] - short["loop"] == 4 + 1 + 1 + 2
    assert longest["loop"] - short["loop"] == 40 * (4 + 1 + 1 + 2)
    assert longest["ebi_read"] - short["ebi_read"] == 40 * 4
    assert longest["ebi_write"] - short["ebi_write"] == 40 * 2  # to zero, and back
