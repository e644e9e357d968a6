"""The search above the picture's own background: all pixels, the brightest stars, and true reasons.

1. Samples of the region give level and noise of the sky in cells (`background`).
2. Row by row, each pixel is compared with the level, plus the star threshold or `SIGMAS` of the
   noise, whichever is more; near the Earth's limb or the Moon with what surrounds it (`steep`).
   What is sharper than a spot is dropped; the rest forms areas (`areas`).
   A part of the picture that is bright all over is its own background, and nothing is found there.
3. Areas that are too large, too small, too faint or drawn out are counted and dropped. Of the rest
   the brightest are kept. Where those of the minimum size are too few, smaller ones fill the list,
   as in pictures of sharp and faint spots.
4. Around each brightest pixel a window is read again: its shape decides, and gives the centroid
   (`spots`).

The time is limited: rows that are not reached by then are not searched, and the search ends so.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import areas, background, spots, steep
from cubestack.firmware_model.cubestar.detection.areas import Areas, Ints, Runs
from cubestack.firmware_model.cubestar.detection.background import CELL, Background
from cubestack.firmware_model.cubestar.detection.contract import (
    Detection,
    DetectionConfig,
    Look,
    PictureStatistics,
    Search,
    SearchEnd,
)
from cubestack.firmware_model.mcu.costs import Meter

SIGMAS = 4
"""Noise alone passes it in 17 pixels of a picture, but hardly in two that touch."""

SPIKE_SIGMAS = 6
"""Spikes and pairs of pixels count from here on, as noise alone never passes it."""

FEWEST_PIXELS = 2
"""Smaller areas are never stars, whatever the setting."""

STRETCHED = 5
"""Ratio of the variances along and across an area from which on it is drawn out; chosen."""

WIDEST_PX = 2.3
"""Standard deviation of the widest spot out of focus. The Moon's disc has 2.8 px without its glare;
areas of more than the maximum size are stars only if they are narrower."""

MOST_STARS_FACTOR = 2
MOST_AREAS, MOST_SHAPES = 256, 64
"""Areas whose sharpness and whose shape are looked at, the brightest ones."""

LIMIT_MS = 190
"""For all rows; the centroids of a full list take less than 35 ms more."""

BLOCK = 8
"""Pixels of a row that share a threshold."""

_BYTE = 255

_TEST = {"ram_read": 5, "i32_add": 10, "loop": 1}
"""Costs of a bright pixel of a short run: is it sharper than a spot?"""

_PIXEL = {"ram_read": 3, "i32_add": 12, "i32_mul": 4}
"""Of one that is not: its part in the sums of its area."""

_RUN = {"ram_read": 20, "ram_write": 12, "i32_add": 18, "loop": 4}
"""Of a run: the runs that it touches, and its area."""

_AREA = {"ram_read": 14, "ram_write": 8, "i32_add": 40, "i32_mul": 8, "i32_div": 5, "loop": 2}
"""Of an area that is not too small: its moments, and its place in the list."""


def background_search(rows: int, columns: int, config: DetectionConfig, meter: Meter) -> Search:
    """Find the stars of a picture of so many 8-bit values; see ``search_stars``."""
    top, left = config.y_start, config.x_start
    height, width = config.y_end - top, config.x_end - left
    start = meter.total
    corner = top * columns + left

    def offsets(y: Ints, x: Ints) -> NDArray[np.int32]:
        return (corner + y * columns + x).astype(np.int32)

    with meter.phase("search"):
        down, across = background.sample_offsets(height, width)
        read = yield Look(offsets(down[:, None], across[None, :]).reshape(-1))
        sky = background.estimate(read.reshape(len(down), len(across)), meter)
        # The program looks at each row when it has read it; the reads cost the same.
        pixels = yield Look(offsets(np.arange(height)[:, None], np.arange(width)).reshape(-1))
        picture = pixels.reshape(height, width)
        limit = start + LIMIT_MS * meter.table.clock_hz // 1000
        bright = _bright(picture, sky, config, meter)
        least = background.UNIT * config.star_threshold // 2
        slopes, searched = steep.steep(sky, height, width), True
        bumps = steep.along_rows(picture, slopes, sky, least, meter)
        if len(bumps):
            searched = len(bumps) <= steep.MOST_PLACES
            bumps = bumps[: steep.MOST_PLACES]
            read = yield Look(offsets(*steep.beside(bumps, height, width)).reshape(-1))
            bumps = steep.all_ways(picture, bumps, read, sky, least, meter)
        bright[slopes] = False
        bright[bumps.rows, bumps.columns] = True
        bright[[0, -1]] = False  # their neighbours would be outside
        bright[:, [0, -1]] = False
        local = steep.Sky(sky, slopes, bumps)
        found, spikes, complete = _areas(pixels, bright, local, limit, meter)
        on_slope = slopes.reshape(-1)[found.peaks]
        sort = _sorted_out(found, on_slope, int(np.median(sky.noises)), config, meter)
        dazzling = np.count_nonzero(picture[slopes] >= spots.SATURATED_DN) > config.max_pixels
        sort = replace(sort, large=sort.large + int(dazzling))  # Earth or Moon
    with meter.phase("centroid"):
        # At the border a window repeats the last pixel.
        grid = np.arange(-spots.HALF, spots.HALF + 1)
        peak_y, peak_x = np.divmod(found.peaks[sort.candidates], width)
        y = np.clip(peak_y[:, None] + grid, 0, height - 1)[:, :, None]
        x = np.clip(peak_x[:, None] + grid, 0, width - 1)[:, None, :]
        places = offsets(y, x)
        values = (yield Look(places.reshape(-1))).reshape(places.shape).astype(np.int64)
        windows = background.UNIT * values - local.under(values, peak_y, peak_x)
        noises = local.noises_at(peak_y, peak_x)
        meter.charge(i32_add=4 * values.size, i32_mul=2 * values.size, loop=values.size)
        saturated = values[:, spots.HALF, spots.HALF] >= spots.SATURATED_DN
        starts = found.middles[sort.candidates] - np.stack([peak_x, peak_y], axis=1)
        sharp = spots.too_sharp(windows, noises)
        some = np.flatnonzero(~sharp)[:MOST_SHAPES]
        windows, noises = windows[some], noises[some]
        starts, saturated = starts[some], saturated[some]
        star, width_px = spots.shapes(windows, starts, saturated, noises, meter)
        # Particles and stars of other lenses look alike: where stars are few, the doubtful count.
        sure, doubtful = np.flatnonzero(star), np.flatnonzero(~star)
        doubtful = doubtful[: max(config.max_stars - len(sure), 0)]
        kept = np.concatenate([sure, doubtful])[: MOST_STARS_FACTOR * config.max_stars]
        measured = spots.centre(
            windows[kept], starts[kept], saturated[kept], noises[kept], width_px, meter
        )
        particles = int(np.count_nonzero(sharp) + np.count_nonzero(~star))
        kept = some[kept]
        chosen = sort.candidates[kept]
        peaks = np.stack([peak_x + left, peak_y + top], axis=1)[kept]
    order = np.argsort(-measured.light, kind="stable")
    centroids = (measured.places + peaks.astype(np.float32))[order]
    return Detection(
        centroids=centroids.astype(np.float32),
        sizes=np.minimum(found.sizes[chosen][order], _BYTE).astype(np.uint8),
        intensities=np.minimum(measured.light, 65_535).astype(np.uint16)[order],
        invalid=min(sort.large + sort.elongated, _BYTE),
        noise=min(sort.small, _BYTE),
        dark_value=round(float(np.mean(sky.levels)) / background.UNIT),
        end=SearchEnd.COMPLETE if complete and searched else SearchEnd.TIME,
        errors_px=measured.errors[order],
        statistics=_statistics(sky, spikes + particles, sort, width_px),
        blind=_blind(sky, rows, columns, config),
    )


def _blind(sky: Background, rows: int, columns: int, config: DetectionConfig) -> NDArray[np.bool_]:
    """Cells of the picture that are too bright for stars, or outside of the region."""
    y = np.arange(CELL // 2, rows, CELL) - config.y_start
    x = np.arange(CELL // 2, columns, CELL) - config.x_start
    bright = np.pad(sky.levels >= steep.BLIND_DN * background.UNIT, 1, constant_values=True)
    down, across = (
        np.clip(places // CELL, -1, size)
        for places, size in zip((y, x), sky.levels.shape, strict=True)
    )
    blind: NDArray[np.bool_] = bright[down[:, None] + 1, across + 1]
    return blind


def _bright(
    picture: NDArray[np.uint8], sky: Background, config: DetectionConfig, meter: Meter
) -> NDArray[np.bool_]:
    """Pixels above the threshold, of all but the outermost ones."""
    height, width = picture.shape
    y, x = np.arange(height)[:, None], np.arange(BLOCK // 2, width + BLOCK, BLOCK)[None, :]
    setting = background.UNIT * config.star_threshold // 2
    above = np.maximum(SIGMAS * sky.interpolated(sky.noises, y, x), setting)
    levels = (sky.interpolated(sky.levels, y, x) + above) // background.UNIT
    thresholds = np.repeat(np.clip(levels, 0, _BYTE).astype(np.uint8), BLOCK, axis=1)
    bright: NDArray[np.bool_] = picture > thresholds[:, :width]
    # A comparison and a branch for each pixel; the threshold steps on with each block, and its
    # step is worked out for each row of a cell.
    steps = height * sky.levels.shape[1]
    meter.charge(i32_add=2 * picture.size + 6 * levels.size + 12 * steps, loop=levels.size + steps)
    meter.charge(ram_read=4 * steps, i32_mul=4 * steps)
    return bright


def _areas(
    pixels: NDArray[np.uint8], bright: NDArray[np.bool_], sky: steep.Sky, limit: int, meter: Meter
) -> tuple[Areas, int, bool]:
    """Areas without spikes, the number of these, and whether the time sufficed for all rows.

    It must not take longer than until the meter's total reaches ``limit``.
    """
    height, width = bright.shape
    runs = areas.runs_of(bright)
    places = runs.places()
    y, x = np.divmod(places, width)
    levels, noises = sky.levels_at(y, x), sky.noises_at(y, x)
    sharp = areas.spikes(pixels, places, width, levels, noises)
    left = areas.without(runs, places[sharp])
    kept = places[~sharp]

    def by_row(offsets: Ints, costs: dict[str, int]) -> NDArray[np.float64]:
        cycles = sum(meter.table.operations[name].cycles * n for name, n in costs.items())
        return np.asarray(cycles * np.bincount(offsets // width, minlength=height), np.float64)

    spent = by_row(places, _TEST) + by_row(kept, _PIXEL) + by_row(left.begins, _RUN)
    spent += by_row(kept, _AREA) / FEWEST_PIXELS  # so many areas at most
    done = int(np.searchsorted(np.cumsum(spent), limit - meter.total, "right"))
    left = Runs(left.begins[left.begins < done * width], left.ends[left.begins < done * width])
    signal = background.UNIT * pixels[places].astype(np.int64) - levels
    counted = int(np.count_nonzero(sharp & (y < done) & (signal > SPIKE_SIGMAS * noises)))
    tested, signal = int(np.count_nonzero(y < done)), signal[~sharp & (y < done)]
    for count, costs in ((tested, _TEST), (len(signal), _PIXEL), (len(left.begins), _RUN)):
        meter.charge(**{name: count * times for name, times in costs.items()})
    measured = areas.measure(left, areas.join(left, width), signal, width)
    return measured, counted, done >= height


@dataclass(frozen=True, eq=False)
class _Sorted:
    """What became of the areas: indices of the candidates, brightest first, and counts."""

    candidates: Ints
    large: int
    small: int
    elongated: int
    aligned: float
    streak_px: float


def _sorted_out(
    found: Areas, on_slope: NDArray[np.bool_], noise: int, config: DetectionConfig, meter: Meter
) -> _Sorted:
    """Tell the areas that may be stars from the others, in so much ``noise`` (1/16 DN)."""
    xx, yy, xy = found.moments.T
    spread = np.hypot(xx - yy, 2 * xy)
    pixel = 1 / 12
    along, across = (xx + yy + spread) / 2 + pixel, (xx + yy - spread) / 2 + pixel
    whole = ~found.large
    in_doubt = (found.sizes == FEWEST_PIXELS) & (found.tops < SPIKE_SIGMAS * noise)
    small = whole & ((found.sizes < FEWEST_PIXELS) | in_doubt)
    drawn_out = whole & ~small & (along > STRETCHED * across)
    wide = on_slope | (along + across > 2 * WIDEST_PX**2)
    large = found.large | (~drawn_out & wide & (found.sizes > config.max_pixels))
    faint = found.tops <= background.UNIT * config.detection_threshold
    brightest = np.argsort(-found.light, kind="stable")
    brightest = brightest[~(small | drawn_out | large)[brightest]]
    # Those of the minimum size first; smaller and fainter ones only where they leave room.
    full = ((found.sizes >= config.min_pixels) & ~faint)[brightest]
    candidates = np.concatenate([brightest[full], brightest[~full]])[:MOST_AREAS]
    looked_at = int(np.count_nonzero(found.sizes >= FEWEST_PIXELS))
    meter.charge(**{name: looked_at * times for name, times in _AREA.items()})
    double_angle = ((xx - yy) + 2j * xy)[drawn_out] / np.maximum(spread[drawn_out], 1e-9)
    some = bool(drawn_out.any())
    return _Sorted(
        candidates,
        int(large.sum()),
        int(small.sum()),
        int(drawn_out.sum()),
        float(np.abs(double_angle.sum())) / max(len(double_angle) + len(brightest), 1),
        float(np.median(np.sqrt(12 * along[drawn_out]))) if some else 0.0,
    )


def _statistics(sky: Background, spikes: int, sort: _Sorted, spot_px: float) -> PictureStatistics:
    levels = sky.levels / background.UNIT
    return PictureStatistics(
        background=float(levels.mean()),
        background_range=float(levels.max() - levels.min()),
        noise=float(np.median(sky.noises)) / background.UNIT,
        saturated=sky.saturated,
        spikes=spikes,
        large=sort.large,
        elongated=sort.elongated,
        aligned=sort.aligned,
        streak_px=sort.streak_px,
        spot_px=spot_px,
    )
