"""Finding stars in a picture: image plane search, region growing, centroids.

CubeStar thesis, sections 4.1.1 to 4.1.3 and 5.3.3. What the text leaves open is settled here:

- A sample above both thresholds starts an area; a neighbour above the star threshold joins it. The
  published firmware has one threshold for both, so both default to 6.
- Growing is recursive, neighbours in the order left, right, up, down. An area that would exceed the
  maximum size stops growing and is invalid; the rest of a large blob is then met again by the
  search, and ends it through the limit of invalid areas.
- Areas below the minimum size are noise. They are counted, and too many of them end the search.
- A pixel of the centroid's grid counts when it was grown, and weighs its value above the star
  threshold. Weighing the plain value of all pixels pulls the centroid towards the grid's middle as
  soon as there is background. Among equally bright pixels (a saturated star) the grid is centred
  on their mean.
- The dark value is the mean of the samples that were not bright enough to start an area.
- Visited pixels are zeroed during the search and written back from a list at its end, because the
  ground downloads the same picture afterwards.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.costs import Meter


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

    def __post_init__(self) -> None:
        """Refuse settings with which the search makes no sense."""
        for name in ("detection_threshold", "star_threshold", "max_invalid", "max_noise"):
            self._check(name, 0, 255)
        for name in ("step", "min_pixels", "max_stars"):
            self._check(name, 1, 255)
        self._check("max_pixels", self.min_pixels, 255)
        self._check("grid_size", 1, 255)
        if self.grid_size % 2 == 0:
            raise DetectionConfigError("grid_size", f"odd, not {self.grid_size}")
        self._check("x_end", self.x_start + 1, 65_535)
        self._check("y_end", self.y_start + 1, 65_535)
        self._check("x_start", 0, 65_535)
        self._check("y_start", 0, 65_535)

    @property
    def seed_threshold(self) -> int:
        """What a sample must exceed to start an area, DN."""
        return max(self.detection_threshold, self.star_threshold)

    def _check(self, name: str, low: int, high: int) -> None:
        value = getattr(self, name)
        if not low <= value <= high:
            raise DetectionConfigError(name, f"{low} to {high}, not {value}")


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
class _Area:
    """Pixels in the order in which growing met them, as offsets into the picture."""

    offsets: list[int]
    values: list[int]
    complete: bool
    looked_at: int


def detect_stars(image: NDArray[np.uint8], config: DetectionConfig, meter: Meter) -> Detection:
    """Find the stars of a picture (rows, columns) of 8-bit values; the picture is not changed.

    Charges every sample, every neighbour looked at, the marking and the restoring. Phases:
    `search` and `centroid`.

    Raises:
        DetectionConfigError: when the region reaches beyond the picture.
    """
    rows, columns = image.shape
    if config.x_end > columns:
        raise DetectionConfigError("x_end", f"at most {columns}, not {config.x_end}")
    if config.y_end > rows:
        raise DetectionConfigError("y_end", f"at most {rows}, not {config.y_end}")
    samples = _Samples(image, config)
    pixels = bytearray(image.tobytes())
    centroids: list[tuple[np.float32, np.float32]] = []
    areas: list[_Area] = []
    invalid = noise = visited = 0
    end = SearchEnd.COMPLETE
    with meter.phase("search"):
        for index in samples.hits():
            seed = samples.offset(index)
            if pixels[seed] <= config.seed_threshold:
                continue
            area = _grow(pixels, seed, columns, rows, config)
            samples.zero(area.offsets, after=index)
            visited += len(area.offsets)
            _charge_growing(area, meter)
            if not area.complete:
                invalid += 1
            elif len(area.offsets) < config.min_pixels:
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
            if end is not SearchEnd.COMPLETE:
                samples.stop_after(index)
                break
        dark_value = samples.charge_and_average(meter)
        meter.charge(ram_read=visited, ebi_write=visited, loop=visited)
    return Detection(
        centroids=np.array(centroids, dtype=np.float32).reshape(-1, 2),
        sizes=np.array([len(area.offsets) for area in areas], dtype=np.uint8),
        intensities=np.array([sum(area.values) for area in areas], dtype=np.uint16),
        invalid=invalid,
        noise=noise,
        dark_value=dark_value,
        end=end,
    )


class _Samples:
    """The sampled pixels in the order of the search, as the search reads them."""

    def __init__(self, image: NDArray[np.uint8], config: DetectionConfig) -> None:
        self._config = config
        self._picture_columns: int = image.shape[1]
        region = image[
            config.y_start : config.y_end : config.step, config.x_start : config.x_end : config.step
        ]
        self._columns: int = region.shape[1]
        self._rows: int = region.shape[0]
        self._values = region.reshape(-1).copy()

    def hits(self) -> list[int]:
        """Indices of the samples above the threshold before anything is zeroed."""
        found: list[int] = np.flatnonzero(self._values > self._config.seed_threshold).tolist()
        return found

    def offset(self, index: int) -> int:
        """Place of a sample in the picture."""
        row, column = divmod(index, self._columns)
        y = self._config.y_start + row * self._config.step
        return y * self._picture_columns + self._config.x_start + column * self._config.step

    def zero(self, offsets: list[int], after: int) -> None:
        """Let the search, which is at sample `after`, read 0 at picture places still to come."""
        step = self._config.step
        for offset in offsets:
            y, x = divmod(offset, self._picture_columns)
            row, off_row = divmod(y - self._config.y_start, step)
            column, off_column = divmod(x - self._config.x_start, step)
            if off_row or off_column or not 0 <= row < self._rows:
                continue
            if 0 <= column < self._columns and row * self._columns + column > after:
                self._values[row * self._columns + column] = 0

    def stop_after(self, index: int) -> None:
        """Forget the samples that the search did not reach."""
        self._values = self._values[: index + 1]

    def charge_and_average(self, meter: Meter) -> int:
        """Charge the reading of the samples; mean of those not above the threshold, rounded."""
        background = self._values[self._values <= self._config.seed_threshold]
        count = len(background)
        read = len(self._values)
        meter.charge(ebi_read=read, i32_add=2 * read + 2 * count, loop=read, i32_div=1)
        total = int(background.sum(dtype=np.int64))
        return (total + count // 2) // count if count else 0


def _grow(pixels: bytearray, seed: int, columns: int, rows: int, config: DetectionConfig) -> _Area:
    """Collect the seed's area depth first and zero its pixels.

    The stack holds for each pixel of the recursion which neighbour comes next.
    """
    threshold, limit, last = config.star_threshold, config.max_pixels, columns * rows
    offsets, values = [seed], [pixels[seed]]
    pixels[seed] = 0
    stack = [(seed, 0)]
    looked_at = 0
    while stack:
        offset, direction = stack.pop()
        if direction < 3:
            stack.append((offset, direction + 1))
        column = offset % columns
        if direction == 0:
            inside, neighbour = column > 0, offset - 1
        elif direction == 1:
            inside, neighbour = column < columns - 1, offset + 1
        elif direction == 2:
            inside, neighbour = offset >= columns, offset - columns
        else:
            inside, neighbour = offset + columns < last, offset + columns
        if not inside:
            continue
        looked_at += 1
        value = pixels[neighbour]
        if value > threshold:
            if len(offsets) == limit:
                return _Area(offsets, values, False, looked_at)
            offsets.append(neighbour)
            values.append(value)
            pixels[neighbour] = 0
            stack.append((neighbour, 0))
    return _Area(offsets, values, True, looked_at)


def _charge_growing(area: _Area, meter: Meter) -> None:
    """Per pixel: a call, zeroing, its list entry and its brightness; per neighbour: a test."""
    count = len(area.offsets)
    meter.charge(
        call=count,
        ebi_write=count,
        ram_write=2 * count,
        ebi_read=area.looked_at,
        loop=area.looked_at,
        i32_add=5 * count + 3 * area.looked_at,
    )


def _centroid(
    area: _Area, columns: int, config: DetectionConfig, meter: Meter
) -> tuple[np.float32, np.float32]:
    """Weighted mean position (x, y) in px over the grid around the brightest pixel."""
    places = [divmod(offset, columns) for offset in area.offsets]
    peak = max(area.values)
    tied = [place for place, value in zip(places, area.values, strict=True) if value == peak]
    middle_y = (2 * sum(y for y, _ in tied) + len(tied)) // (2 * len(tied))
    middle_x = (2 * sum(x for _, x in tied) + len(tied)) // (2 * len(tied))
    half = config.grid_size // 2
    sum_x = sum_y = weight = 0
    for (y, x), value in zip(places, area.values, strict=True):
        if abs(y - middle_y) <= half and abs(x - middle_x) <= half:
            above = value - config.star_threshold
            sum_x += above * (x - middle_x)
            sum_y += above * (y - middle_y)
            weight += above
    count = len(places)
    meter.charge(
        ram_read=4 * count,
        i32_add=12 * count,
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
