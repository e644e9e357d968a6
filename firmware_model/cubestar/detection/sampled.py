"""The published search: image plane search, region growing, centroids.

CubeStar thesis, sections 4.1.1 to 4.1.3 and 5.3.3. Not in the text, so chosen here:

- A sample above both thresholds starts an area; a neighbour above the star threshold joins it. The
  published firmware has one threshold for both, so both default to 6.
- Growing is recursive, neighbours in the order left, right, up, down. An area that would exceed the
  maximum size stops growing and is invalid; the search meets the rest of a large blob again, and
  ends at the limit of invalid areas.
- Areas below the minimum size are noise. They are counted, and too many of them end the search.
- A pixel of the centroid's grid counts when it was grown. It weighs its value, as printed, or its
  value above the star threshold: the plain value pulls the centroid towards the middle of the grid
  where there is background. Among equally bright pixels (a saturated star) the grid is centred on
  their mean.
- The dark value is the mean of the samples that were not bright enough to start an area.
- Visited pixels are zeroed during the search and restored from a list at its end, because the
  ground downloads the same image afterwards.
"""

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection.contract import (
    Detection,
    DetectionConfig,
    Look,
    Put,
    Search,
    SearchEnd,
)
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.inner_loops import BYTES, FLOATS, INT, INTS, Loop

SAMPLED_SEARCH = Loop("sampled_search", BYTES, INT, INT, INTS, FLOATS, INTS, INTS, INTS)


@dataclass(frozen=True)
class _Area:
    """Pixels in the order in which growing met them, as offsets into the picture."""

    offsets: list[int]
    values: list[int]
    complete: bool
    looked_at: int


def sampled_search(rows: int, columns: int, config: DetectionConfig, meter: Meter) -> Search:
    """Find the stars of an image of ``rows`` by ``columns``; see ``search_stars``."""
    along = np.arange(config.x_start, config.x_end, config.step, dtype=np.int32)
    down = np.arange(config.y_start, config.y_end, config.step, dtype=np.int32)
    samples = (down[:, None] * columns + along).reshape(-1)
    centroids: list[tuple[np.float32, np.float32]] = []
    areas: list[_Area] = []
    visited: list[int] = []
    values: list[int] = []
    invalid = noise = read = total = background = 0
    end = SearchEnd.COMPLETE
    with meter.phase("search"):
        while read < len(samples) and end is SearchEnd.COMPLETE:
            found = yield Look(samples[read:], config.seed_threshold)
            read += len(found)
            hit = int(found[-1]) > config.seed_threshold
            dark = found[:-1] if hit else found
            total += int(dark.sum(dtype=np.int64))
            background += len(dark)
            if not hit:
                break
            area = yield from _grow(int(samples[read - 1]), int(found[-1]), columns, rows, config)
            visited += area.offsets
            values += area.values
            count = len(area.offsets)
            _charge_growing(count, area.looked_at, meter)
            if not area.complete:
                invalid += 1
            elif count < config.min_pixels:
                noise += 1
            else:
                areas.append(area)
                with meter.phase("centroid"):
                    _charge_centroids(count, 1, meter)
                centroids.append(_centroid(area, columns, config))
            if len(areas) == config.max_stars:
                end = SearchEnd.STARS
            elif invalid > config.max_invalid:
                end = SearchEnd.INVALID
            elif noise > config.max_noise:
                end = SearchEnd.NOISE
        _charge_samples(read, background, len(visited), meter)
        yield Put(np.array(visited, np.int32), np.array(values, np.uint8))
    return Detection(
        centroids=np.array(centroids, dtype=np.float32).reshape(-1, 2),
        sizes=np.array([len(area.offsets) for area in areas], dtype=np.uint8),
        intensities=np.array([sum(area.values) for area in areas], dtype=np.uint16),
        invalid=invalid,
        noise=noise,
        dark_value=(total + background // 2) // background if background else 0,
        end=end,
    )


def compiled_search(
    pixels: NDArray[np.uint8], rows: int, columns: int, config: DetectionConfig, meter: Meter
) -> Detection:
    """The same search and charges on a memory (rows * columns,) that is changed; charges the
    accesses too."""
    most = config.max_stars
    centroids, counts = np.empty((most, 2), np.float32), np.empty(11, np.int64)
    sizes, sums = np.empty((2, most), np.int64)
    SAMPLED_SEARCH(pixels, rows, columns, _settings(config), centroids, sizes, sums, counts)
    end, invalid, noise, stars, read, background, total, *grown = counts.tolist()
    visited, tests, areas, star_pixels = grown
    with meter.phase("search"):
        meter.charge(ebi_read=read + tests, ebi_write=2 * visited)
        if areas:
            _charge_growing(visited, tests, meter)
        _charge_samples(read, background, visited, meter)
    if stars:
        with meter.phase("centroid"):
            _charge_centroids(star_pixels, stars, meter)
    return Detection(
        centroids=centroids[:stars],
        sizes=sizes[:stars].astype(np.uint8),
        intensities=sums[:stars].astype(np.uint16),
        invalid=invalid,
        noise=noise,
        dark_value=(total + background // 2) // background if background else 0,
        end=_ENDS[end],
    )


#: In the order of sampled.cpp.
_ENDS = SearchEnd.COMPLETE, SearchEnd.STARS, SearchEnd.INVALID, SearchEnd.NOISE


def _settings(config: DetectionConfig) -> NDArray[np.int64]:
    """In the order of sampled.cpp."""
    region = config.step, config.x_start, config.x_end, config.y_start, config.y_end
    areas = config.seed_threshold, config.star_threshold, config.min_pixels, config.max_pixels
    limits = config.grid_size // 2, config.max_stars, config.max_invalid, config.max_noise
    return np.array([*region, *areas, *limits, _floor(config)], np.int64)


def _floor(config: DetectionConfig) -> int:
    return 0 if config.plain_weights else config.star_threshold


def _charge_growing(count: int, tests: int, meter: Meter) -> None:
    """Of each of ``count`` pixels two calls, a list entry and a brightness, and its place in the
    list of visited ones; ``tests`` of neighbours."""
    meter.charge(call=2 * count, ram_write=2 * count, loop=tests, i32_add=5 * count + 3 * tests)
    meter.charge(ram_read=count, ram_write=count, loop=count)


def _charge_centroids(pixels: int, count: int, meter: Meter) -> None:
    meter.charge(ram_read=4 * pixels, i32_add=24 * pixels, i32_mul=2 * pixels, loop=2 * pixels)
    meter.charge(i32_div=2 * count, f32_convert=5 * count, f32_div=2 * count, f32_add=2 * count)


def _charge_samples(read: int, background: int, visited: int, meter: Meter) -> None:
    """The place, two comparisons and a step; what does not fit into registers comes from RAM. The
    visited pixels are restored."""
    meter.charge(i32_add=4 * read + 2 * background, ram_read=3 * read, loop=read, i32_div=1)
    meter.charge(ram_read=visited, loop=visited)


def _grow(
    seed: int, value: int, columns: int, rows: int, config: DetectionConfig
) -> Generator[Look | Put, Any, _Area]:
    """Collect the seed's area depth first and zero its pixels. A stack replaces the recursion."""
    offsets, values = [seed], [value]
    yield _zero(seed)
    stack, looked_at = _neighbours(seed, columns, rows), 0
    while stack:
        found = yield Look(np.array(stack[::-1], np.int32), config.star_threshold)
        looked_at += len(found)
        place, value = stack[-len(found)], int(found[-1])
        del stack[-len(found) :]
        if value <= config.star_threshold:
            break
        if len(offsets) == config.max_pixels:
            return _Area(offsets, values, False, looked_at)
        offsets.append(place)
        values.append(value)
        yield _zero(place)
        stack += _neighbours(place, columns, rows)
    return _Area(offsets, values, True, looked_at)


def _zero(place: int) -> Put:
    return Put(np.array([place], np.int32), np.zeros(1, np.uint8))


def _neighbours(place: int, columns: int, rows: int) -> list[int]:
    """Down, up, right, left, as far as they are in the picture: the last is looked at first."""
    column = place % columns
    around = (
        (place + columns < columns * rows, place + columns),
        (place >= columns, place - columns),
        (column < columns - 1, place + 1),
        (column > 0, place - 1),
    )
    return [neighbour for inside, neighbour in around if inside]


def _centroid(area: _Area, columns: int, config: DetectionConfig) -> tuple[np.float32, np.float32]:
    """Weighted mean position (x, y) in px over the grid around the brightest pixel."""
    floor = _floor(config)
    places = [divmod(offset, columns) for offset in area.offsets]
    peak = max(area.values)
    tied = [place for place, value in zip(places, area.values, strict=True) if value == peak]
    middle_y = (2 * sum(y for y, _ in tied) + len(tied)) // (2 * len(tied))
    middle_x = (2 * sum(x for _, x in tied) + len(tied)) // (2 * len(tied))
    half = config.grid_size // 2
    sum_x = sum_y = weight = 0
    for (y, x), value in zip(places, area.values, strict=True):
        if abs(y - middle_y) <= half and abs(x - middle_x) <= half:
            above = value - floor
            sum_x += above * (x - middle_x)
            sum_y += above * (y - middle_y)
            weight += above
    total = np.float32(weight)
    with np.errstate(invalid="ignore"):  # a grid without any of the area's pixels
        return (
            np.float32(middle_x) + np.float32(sum_x) / total,
            np.float32(middle_y) + np.float32(sum_y) / total,
        )
