"""Finding stars in a picture: image plane search, region growing, centroids.

CubeStar thesis, sections 4.1.1 to 4.1.3 and 5.3.3. What the text leaves open is settled here:

- A sample above both thresholds starts an area; a neighbour above the star threshold joins it. The
  published firmware has one threshold for both, so both default to 6.
- Growing is recursive, neighbours in the order left, right, up, down. An area that would exceed the
  maximum size stops growing and is invalid; the rest of a large blob is then met again by the
  search, and ends it through the limit of invalid areas.
- Areas below the minimum size are noise. They are counted, and too many of them end the search.
- A pixel of the centroid's grid counts when it was grown. It weighs its value, as printed, or its
  value above the star threshold: the plain value pulls the centroid towards the grid's middle as
  soon as there is background. Among equally bright pixels (a saturated star) the grid is centred
  on their mean.
- The dark value is the mean of the samples that were not bright enough to start an area.
- Visited pixels are zeroed during the search and written back from a list at its end, because the
  ground downloads the same picture afterwards.

The search names the pixels that it reads and writes, in its order, and leaves the accesses to
whoever has the picture: an array here, a memory behind an FPGA elsewhere.
"""

from collections.abc import Generator
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter


class DetectionConfigError(ValueError):
    """A detection setting out of range; `setting` names the field of `DetectionConfig`."""

    def __init__(self, setting: str, requirement: str) -> None:
        """Say which setting must be what."""
        super().__init__(f"{setting} must be {requirement}")
        self.setting = setting


class SearchEnd(Enum):
    """Why a search ended."""

    COMPLETE = "the whole region was searched"
    STARS = "the list of stars was full"
    INVALID = "there were too many invalid areas"
    NOISE = "there were too many noise areas"


@dataclass(frozen=True)
class DetectionConfig:
    """Settings of telecommands 20 to 23, with the published values as defaults.

    Attributes:
        step: distance of sampled pixels and rows in px.
        x_start, x_end, y_start, y_end: region of the samples in px, ends excluded.
        detection_threshold: a sample above it (and the star threshold) starts an area, DN.
        star_threshold: a neighbour above it joins the area, DN.
        min_pixels: smaller areas are noise.
        max_pixels: larger areas are invalid.
        grid_size: width of the square around the brightest pixel that gives the centroid, odd.
        max_stars: the search ends with so many stars.
        max_invalid: the search ends with more invalid areas.
        max_noise: the search ends with more noise areas.
        plain_weights: a pixel weighs its value, else its value above the star threshold.
    """

    step: int = 3
    x_start: int = 0
    x_end: int = 1024
    y_start: int = 0
    y_end: int = 512
    detection_threshold: int = 6
    star_threshold: int = 6
    min_pixels: int = 6
    max_pixels: int = 60
    grid_size: int = 5
    max_stars: int = 20
    max_invalid: int = 50
    max_noise: int = 255
    plain_weights: bool = False

    def __post_init__(self) -> None:
        """Refuse settings with which the search makes no sense."""
        limits = {
            **dict.fromkeys(("detection_threshold", "star_threshold"), (0, 255)),
            **dict.fromkeys(("max_invalid", "max_noise"), (0, 255)),
            **dict.fromkeys(("step", "min_pixels", "max_stars", "grid_size"), (1, 255)),
            "max_pixels": (self.min_pixels, 255),
            "x_end": (self.x_start + 1, 65_535),
            "y_end": (self.y_start + 1, 65_535),
            **dict.fromkeys(("x_start", "y_start"), (0, 65_535)),
        }
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise DetectionConfigError(name, f"{low} to {high}, not {value}")
        if self.grid_size % 2 == 0:
            raise DetectionConfigError("grid_size", f"odd, not {self.grid_size}")

    @property
    def seed_threshold(self) -> int:
        """What a sample must exceed to start an area, DN."""
        return max(self.detection_threshold, self.star_threshold)


@dataclass(frozen=True, eq=False)
class Detection:
    """What a search found, in the order of the search (row by row).

    Attributes:
        centroids: (n, 2) x and y in px.
        sizes: (n,) pixels of each area.
        intensities: (n,) sum of the values of each area's pixels, DN.
        invalid: areas above the maximum size.
        noise: areas below the minimum size.
        dark_value: mean of the sampled background in DN, 0 when nothing was background.
        end: why the search ended.
    """

    centroids: NDArray[np.float32]
    sizes: NDArray[np.uint8]
    intensities: NDArray[np.uint16]
    invalid: int
    noise: int
    dark_value: int
    end: SearchEnd


@dataclass(frozen=True)
class Look:
    """Read pixels one after the other, up to and with the first one above ``above``.

    The answer are the values read, uint8, at most as many as ``offsets``, (n,) int32.
    """

    offsets: NDArray[np.int32]
    above: int


@dataclass(frozen=True)
class Put:
    """Write pixels: ``offsets`` (n,) int32, ``values`` (n,) uint8."""

    offsets: NDArray[np.int32]
    values: NDArray[np.uint8]


Search = Generator[Look | Put, Any, Detection]
"""A search; whoever runs it performs the accesses and charges them."""


@dataclass(frozen=True)
class _Area:
    """Pixels in the order in which growing met them, as offsets into the picture."""

    offsets: list[int]
    values: list[int]
    complete: bool
    looked_at: int


def detect_stars(image: NDArray[np.uint8], config: DetectionConfig, meter: Meter) -> Detection:
    """Find the stars of a picture (rows, columns) of 8-bit values; the picture is not changed.

    Charges what ``search_stars`` charges, and every access to the picture.

    Raises:
        DetectionConfigError: when the region reaches beyond the picture.
    """
    rows, columns = image.shape
    pixels = image.reshape(-1).copy()
    search, answer = search_stars(rows, columns, config, meter), None
    while True:
        try:
            access = search.send(answer)
        except StopIteration as done:
            detection: Detection = done.value
            return detection
        match access:
            case Look():
                values = pixels[access.offsets]
                above = np.flatnonzero(values > access.above)
                answer = values[: above[0] + 1] if len(above) else values
                meter.charge(ebi_read=len(answer))
            case Put():
                pixels[access.offsets] = access.values
                meter.charge(ebi_write=len(access.offsets))


def search_stars(rows: int, columns: int, config: DetectionConfig, meter: Meter) -> Search:
    """Find the stars of a picture of so many 8-bit values that is somewhere else.

    Charges all but the accesses that it yields. Phases: `search` and `centroid`. Raises as
    ``detect_stars`` does.
    """
    if config.x_end > columns:
        raise DetectionConfigError("x_end", f"at most {columns}, not {config.x_end}")
    if config.y_end > rows:
        raise DetectionConfigError("y_end", f"at most {rows}, not {config.y_end}")
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
            count = len(area.offsets)  # two calls, a list entry, a brightness; a neighbour's test
            tests = area.looked_at
            meter.charge(
                call=2 * count, ram_write=2 * count, loop=tests, i32_add=5 * count + 3 * tests
            )
            meter.charge(ram_read=count, ram_write=count, loop=count)  # into the list of visited
            if not area.complete:
                invalid += 1
            elif count < config.min_pixels:
                noise += 1
            else:
                areas.append(area)
                with meter.phase("centroid"):
                    centroids.append(_centroid(area, columns, config, meter))
            if len(areas) == config.max_stars:
                end = SearchEnd.STARS
            elif invalid > config.max_invalid:
                end = SearchEnd.INVALID
            elif noise > config.max_noise:
                end = SearchEnd.NOISE
        # The place, two comparisons and a step; what does not fit into registers comes from RAM.
        meter.charge(i32_add=4 * read + 2 * background, ram_read=3 * read, loop=read, i32_div=1)
        meter.charge(ram_read=len(visited), loop=len(visited))
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


def _grow(
    seed: int, value: int, columns: int, rows: int, config: DetectionConfig
) -> Generator[Look | Put, Any, _Area]:
    """Collect the seed's area depth first and zero its pixels.

    What the recursion still has to look at is a stack, its top the next place.
    """
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


def _centroid(
    area: _Area, columns: int, config: DetectionConfig, meter: Meter
) -> tuple[np.float32, np.float32]:
    """Weighted mean position (x, y) in px over the grid around the brightest pixel."""
    floor = 0 if config.plain_weights else config.star_threshold
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
    count = len(places)
    meter.charge(
        ram_read=4 * count,
        i32_add=24 * count,
        i32_mul=2 * count,
        loop=2 * count,
        i32_div=2,
        f32_convert=5,
        f32_div=2,
        f32_add=2,
    )
    total = np.float32(weight)
    return (
        np.float32(middle_x) + np.float32(sum_x) / total,
        np.float32(middle_y) + np.float32(sum_y) / total,
    )
