"""The search above the local background: all pixels, the brightest stars, and statistics.

1. Samples of the region give level and noise of the sky in cells (``star_tracker.background``).
2. Row by row, each pixel is compared with the level plus the star threshold or `SIGMAS` of the
   noise, whichever is more; near the Earth's limb or the Moon with its surroundings (`steep`).
   Pixels sharper than a spot are dropped; the rest forms areas (`areas`).
3. Areas that are too large, too small, too faint or elongated are counted and dropped. The
   brightest others are kept. Where those of the minimum size are too few, smaller ones fill the
   list, as in images of sharp and faint spots.
4. A window around each brightest pixel is read again, judged by its shape and measured (`spots`).

Time is limited: rows that are not reached are not searched. What it costs is in `charges`.
"""

from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import areas, charges, spots, steep
from cubestack.firmware_model.cubestar.detection.areas import Areas
from cubestack.firmware_model.cubestar.detection.contract import (
    Detection,
    DetectionConfig,
    Look,
    PictureStatistics,
    Search,
    SearchEnd,
)
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker import background
from cubestack.firmware_model.star_tracker.background import CELL, UNIT, Ints, Marks, SkyBackground
from cubestack.firmware_model.star_tracker.regions import Runs

STEP = 4  #: distance of the background's samples in px
SIGMAS = 4  #: noise alone passes it in 17 pixels of a picture, but hardly in two that touch
SPIKE_SIGMAS = 6  #: spikes and pairs of pixels count from here on, as noise alone never passes it
FEWEST_PIXELS = 2  #: smaller areas are never stars, whatever the setting

#: Ratio of the variances along and across an area from which on it is drawn out; chosen.
STRETCHED = 5

#: Standard deviation of the widest spot out of focus. The Moon's disc has 2.8 px without its glare;
#: areas of more than the maximum size are stars only if they are narrower.
WIDEST_PX = 2.3

MOST_STARS_FACTOR = 2
#: Areas whose sharpness and whose shape are looked at, the brightest ones.
MOST_AREAS, MOST_SHAPES = 256, 64

LIMIT_MS = 190  #: for all rows; the centroids of a full list take less than 35 ms more

_BYTE = 255

Bytes = NDArray[np.uint8]


def background_search(rows: int, columns: int, config: DetectionConfig, meter: Meter) -> Search:
    """Find the stars of an image of ``rows`` by ``columns``; see ``search_stars``."""
    region = _Region(config.y_start, config.x_start, config.y_end, config.x_end, columns)
    limit = meter.total + LIMIT_MS * meter.table.clock_hz // 1000
    with meter.phase("search"):
        sky, picture = yield from _read(region, meter)
        bright, local, searched = yield from _bright(region, picture, sky, config, meter)
        found, spikes, complete = _areas(picture, bright, local, limit, meter)
        on_slope = local.slopes.reshape(-1)[found.peaks]
        sort = _sorted_out(found, on_slope, int(np.median(sky.noises)), config)
        looked_at = int(np.count_nonzero(found.sizes >= FEWEST_PIXELS))
        charges.charge_each(looked_at, charges.AREA, meter)
        slope_saturated = picture[local.slopes] >= spots.SATURATED_DN
        dazzling = np.count_nonzero(slope_saturated) > config.max_pixels  # Earth or Moon
        sort = replace(sort, large=sort.large + int(dazzling))
    with meter.phase("centroid"):
        stars = yield from _stars(region, found, sort.candidates, local, config, meter)
    order = np.argsort(-stars.measured.light, kind="stable")
    places = stars.measured.places + stars.peaks.astype(np.float32)
    return Detection(
        centroids=places[order].astype(np.float32),
        sizes=np.minimum(found.sizes[stars.areas][order], _BYTE).astype(np.uint8),
        intensities=np.minimum(stars.measured.light, 65_535).astype(np.uint16)[order],
        invalid=min(sort.large + sort.elongated, _BYTE),
        noise=min(sort.small, _BYTE),
        dark_value=round(float(np.mean(sky.levels)) / UNIT),
        end=SearchEnd.COMPLETE if complete and searched else SearchEnd.TIME,
        errors_px=stars.measured.errors[order],
        statistics=_statistics(sky, spikes + stars.particles, sort, stars.width_px),
        blind=_blind(sky, rows, columns, config),
    )


@dataclass(frozen=True)
class _Region:
    top: int
    left: int
    bottom: int
    right: int
    columns: int

    @property
    def height(self) -> int:
        return self.bottom - self.top

    @property
    def width(self) -> int:
        return self.right - self.left

    def look(self, y: Ints, x: Ints) -> Look:
        offsets = (self.top + y) * self.columns + self.left + x
        return Look(offsets.astype(np.int32).reshape(-1))


@lru_cache(maxsize=2)
def _every_offset(region: _Region) -> NDArray[np.int32]:
    """Of all pixels of a region; read-only."""
    offsets = region.look(np.arange(region.height)[:, None], np.arange(region.width)).offsets
    offsets.flags.writeable = False
    return offsets


def _read(region: _Region, meter: Meter) -> Generator[Look, Any, tuple[SkyBackground, Bytes]]:
    """The background and the pixels (rows, columns) of a region."""
    height, width = region.height, region.width
    down, across = background.sample_offsets(height, width, STEP)
    read = yield region.look(down[:, None], across[None, :])
    sky = background.estimate(read.reshape(len(down), len(across)), STEP)
    charges.charge_background(sky, meter)
    # The program looks at each row when it has read it; the reads cost the same.
    pixels = yield Look(_every_offset(region))
    return sky, pixels.reshape(height, width)


def _bright(
    region: _Region, picture: Bytes, sky: SkyBackground, config: DetectionConfig, meter: Meter
) -> Generator[Look, Any, tuple[Marks, steep.LocalBackground, bool]]:
    """Pixels above the sky around them, except the outermost ones; this sky; and whether all slopes
    were searched."""
    height, width = picture.shape
    least = UNIT * config.star_threshold // 2
    bright = sky.brighter(picture, SIGMAS, least)
    charges.charge_thresholds(height, width, meter)
    slopes, searched = steep.steep(sky, height, width), True
    bumps = steep.along_rows(picture, slopes, sky, least)
    charges.charge_each(int(np.count_nonzero(slopes)), charges.SLOPE_PIXEL, meter)
    if len(bumps):
        searched = len(bumps) <= steep.MOST_PLACES
        bumps = bumps[: steep.MOST_PLACES]
        charges.charge_each(len(bumps), charges.BUMP, meter)
        read = yield region.look(*steep.beside(bumps, height, width))
        bumps = steep.all_ways(picture, bumps, read, sky, least)
    bright[slopes] = False
    bright[bumps.rows, bumps.columns] = True
    bright[[0, -1]] = False  # their neighbours would be outside
    bright[:, [0, -1]] = False
    return bright, steep.LocalBackground(sky, slopes, bumps), searched


def _areas(
    picture: Bytes, bright: Marks, sky: steep.LocalBackground, limit: int, meter: Meter
) -> tuple[Areas, int, bool]:
    """Areas without spikes, the number of spikes, and whether all rows were searched before the
    meter's total reached ``limit``."""
    (height, width), pixels = bright.shape, picture.reshape(-1)
    runs = Runs.of(bright)
    places = runs[areas.short(runs)].places()
    y, x = np.divmod(places, width)
    levels, noises = sky.at(y, x)
    sharp = areas.spikes(pixels, places, width, levels, noises)
    left = runs.without(places[sharp])
    rows_of = (
        (y, charges.TEST, 1),
        (y[~sharp], charges.PIXEL, 1),
        (left.begins // width, charges.RUN, 1),
        (y[~sharp], charges.AREA, 1 / FEWEST_PIXELS),  # upper bound of the areas
    )
    done = charges.rows_in_time(rows_of, height, limit - meter.total, meter)
    left, in_time = left[left.begins < done * width], y < done
    signal = UNIT * pixels[places].astype(np.int64) - levels
    counted = int(np.count_nonzero(sharp & in_time & (signal > SPIKE_SIGMAS * noises)))
    signal = signal[~sharp & in_time]
    charges.charge_each(int(np.count_nonzero(in_time)), charges.TEST, meter)
    charges.charge_each(len(signal), charges.PIXEL, meter)
    charges.charge_each(len(left), charges.RUN, meter)
    return areas.measure(left, signal, width), counted, done >= height


@dataclass(frozen=True, eq=False)
class _Stars:
    """Stars among the candidates: centroids, brightest pixels (n, 2) in the image, areas (n,),
    number of particles, and width of the spots."""

    measured: spots.Centroids
    peaks: Ints
    areas: Ints
    particles: int
    width_px: float


def _stars(
    region: _Region,
    found: Areas,
    candidates: Ints,
    sky: steep.LocalBackground,
    config: DetectionConfig,
    meter: Meter,
) -> Generator[Look, Any, _Stars]:
    """Read a window around each candidate's brightest pixel, and judge its shape."""
    # At the border a window repeats the last pixel.
    grid = np.arange(-spots.HALF, spots.HALF + 1)
    peak_y, peak_x = np.divmod(found.peaks[candidates], region.width)
    y = np.clip(peak_y[:, None] + grid, 0, region.height - 1)[:, :, None]
    x = np.clip(peak_x[:, None] + grid, 0, region.width - 1)[:, None, :]
    read = yield region.look(y, x)
    values = read.reshape(-1, spots.SIDE, spots.SIDE).astype(np.int64)
    windows = UNIT * values - sky.under(values, y, x, sky.slopes[peak_y, peak_x])
    _, noises = sky.at(peak_y, peak_x)
    charges.charge_windows_read(len(windows), meter)
    saturated = values[:, spots.HALF, spots.HALF] >= spots.SATURATED_DN
    middles = np.stack([found.moments.x, found.moments.y], axis=1)[candidates]
    starts = middles - np.stack([peak_x, peak_y], axis=1)
    sharp = spots.too_sharp(windows, noises)
    some = np.flatnonzero(~sharp)[:MOST_SHAPES]
    windows, noises = windows[some], noises[some]
    starts, saturated = starts[some], saturated[some]
    star, width_px = spots.shapes(windows, starts, saturated, noises)
    charges.charge_rounds(len(windows), spots.SHAPE_ROUNDS, meter)
    # Particles and stars of other lenses look alike: where stars are few, the doubtful count.
    sure, doubtful = np.flatnonzero(star), np.flatnonzero(~star)
    doubtful = doubtful[: max(config.max_stars - len(sure), 0)]
    kept = np.concatenate([sure, doubtful])[: MOST_STARS_FACTOR * config.max_stars]
    measured = spots.centre(windows[kept], starts[kept], saturated[kept], noises[kept], width_px)
    charges.charge_rounds(len(kept), spots.ROUNDS, meter)
    charges.charge_centroids(len(kept), meter)
    particles = int(np.count_nonzero(sharp) + np.count_nonzero(~star))
    peaks = np.stack([peak_x + region.left, peak_y + region.top], axis=1)[some[kept]]
    return _Stars(measured, peaks, candidates[some[kept]], particles, width_px)


@dataclass(frozen=True, eq=False)
class _Sorted:
    """Areas sorted out: indices of the candidates, brightest first, and counts of the others."""

    candidates: Ints
    large: int
    small: int
    elongated: int
    aligned: float
    streak_px: float


def _sorted_out(found: Areas, on_slope: Marks, noise: int, config: DetectionConfig) -> _Sorted:
    """Separate the areas that may be stars from the others; ``noise`` in 1/16 DN."""
    moments, pixel = found.moments, 1 / 12
    along, across = moments.along + pixel, moments.across + pixel
    whole = ~found.large
    in_doubt = (found.sizes == FEWEST_PIXELS) & (found.tops < SPIKE_SIGMAS * noise)
    small = whole & ((found.sizes < FEWEST_PIXELS) | in_doubt)
    drawn_out = whole & ~small & (along > STRETCHED * across)
    wide = on_slope | (along + across > 2 * WIDEST_PX**2)
    large = found.large | (~drawn_out & wide & (found.sizes > config.max_pixels))
    faint = found.tops <= UNIT * config.detection_threshold
    brightest = np.argsort(-moments.light, kind="stable")
    brightest = brightest[~(small | drawn_out | large)[brightest]]
    # Those of the minimum size first; smaller and fainter ones only where they leave room.
    full = ((found.sizes >= config.min_pixels) & ~faint)[brightest]
    candidates = np.concatenate([brightest[full], brightest[~full]])[:MOST_AREAS]
    double_angle = (moments.xx - moments.yy + 2j * moments.xy)[drawn_out]
    double_angle /= np.maximum(moments.spread[drawn_out], 1e-9)
    some = bool(drawn_out.any())
    return _Sorted(
        candidates,
        int(large.sum()),
        int(small.sum()),
        int(drawn_out.sum()),
        float(np.abs(double_angle.sum())) / max(len(double_angle) + len(brightest), 1),
        float(np.median(np.sqrt(12 * along[drawn_out]))) if some else 0.0,
    )


def _statistics(
    sky: SkyBackground, spikes: int, sort: _Sorted, spot_px: float
) -> PictureStatistics:
    levels = sky.levels / UNIT
    return PictureStatistics(
        background=float(levels.mean()),
        background_range=float(levels.max() - levels.min()),
        noise=float(np.median(sky.noises)) / UNIT,
        saturated=sky.saturated,
        spikes=spikes,
        large=sort.large,
        elongated=sort.elongated,
        aligned=sort.aligned,
        streak_px=sort.streak_px,
        spot_px=spot_px,
    )


def _blind(
    sky: SkyBackground, rows: int, columns: int, config: DetectionConfig
) -> NDArray[np.bool_]:
    """Cells of the picture that are too bright for stars, or outside of the region."""
    y = np.arange(CELL // 2, rows, CELL) - config.y_start
    x = np.arange(CELL // 2, columns, CELL) - config.x_start
    bright = np.pad(sky.levels >= steep.BLIND_DN * UNIT, 1, constant_values=True)
    down, across = (
        np.clip(places // CELL, -1, size)
        for places, size in zip((y, x), sky.levels.shape, strict=True)
    )
    blind: Marks = bright[down[:, None] + 1, across + 1]
    return blind
