"""The Sun's centre from the 15 x 15 window that the sun FPGA presents.

CubeSense thesis, sections 4.4.2, 6.6.2, 6.6.3, appendix C.6 and table 5.1: mean of the coordinates
of all pixels that reach the threshold, weighted by value, plus the window's origin, less the
boresight; then undistorted.

As printed that is all; only a division by 0 means no Sun. The window's position at the image border
depends on the gateware (``ReadOut.window_origin``).

An extension: a Sun larger than the window is cut, mostly at the bottom, and its mean moves. A row
that reaches the window's left or right border is then left out of the mean of x, a column that
reaches the upper or lower one out of the mean of y. If nothing would remain, all count.

Another: the light must be a Sun. It is none if the FPGA saw no run of bright pixels, if too few or
too many pixels reach the threshold, if they are not round or not connected, their middle is not
saturated, or their centre lies outside of the field of view, where the lens images nothing and an
int of 1/100 px may overflow. A light with an edge sharper than that of the Sun's image may be a Sun
or sunlit structure: it is reported with a standard deviation that reflects this. The FPGA finds
only the first bright light of the image, so a false one before the Sun hides it: then there is
none. The limits are assumed, around images of 6 to 8 px in radius (section 5.1.3.2).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision.arithmetic import sequential_sum
from cubestack.firmware_model.cubesense.vision.distortion import RIM_PX, RadiusTable
from cubestack.firmware_model.cubesense.vision.masks import Mask, masked
from cubestack.firmware_model.cubesense.vision.nadir import Direction, angle_of
from cubestack.firmware_model.interface.cubesense import codes, fpga
from cubestack.firmware_model.mcu.costs import Meter

COORDINATE_BYTES = 4  #: x low, x high, y low, y high of the first Sun pixel, before the window

FULL_SCALE = 255
ROUND = 4  #: largest difference between width and height of a whole Sun, in pixels
TIPS = 4  #: pixels of a small Sun that are alone in their row or column: they do not widen it

#: Smallest ratio of the squared number of edge pixels of a Sun to the number of bright pixels.
SOFT = 5

#: Edge pixels of a Sun are brighter than this, and below its threshold: 30 % of its level (5.7).
EDGE_LEVEL = 100

SIGMA_DEG = 0.03  #: of alpha and beta, fitted: noise, and edges in whole pixels

#: Of a light that may be no Sun: that of a position anywhere in the field, half its radius.
SHARP_SIGMA_DEG = 48.0

_LARGEST_ANGLE = codes.LARGEST_ANGLE_DEG * 100  #: in 1/100 deg; beyond any of this lens


@dataclass(frozen=True, eq=False)
class SunConfig:
    """Settings of the search in the window."""

    table: RadiusTable  #: undistorts the centre; an equidistant one
    threshold: int = 225  #: a pixel at or above it belongs to the Sun
    boresight: tuple[float, float] = (369.0, 250.0)  #: (x, y) in px
    masks: Sequence[Mask] = ()  #: areas whose pixels do not count
    #: min_pixels, max_pixels: fewer, or more, are no Sun
    min_pixels: int = 7
    max_pixels: int = 190
    printed: bool = False  #: without the extensions


@dataclass(frozen=True)
class SunResult(Direction):
    """A direction, and the number of ``pixels`` that reached the threshold."""

    pixels: int = 0


def window_bytes(read_out: fpga.ReadOut = fpga.FULL_SIZE) -> int:
    """Bytes that the FPGA presents: coordinates and window."""
    return COORDINATE_BYTES + read_out.window**2


def find_sun(
    data: NDArray[np.uint8],
    config: SunConfig,
    meter: Meter,
    read_out: fpga.ReadOut = fpga.FULL_SIZE,
) -> SunResult:
    """Measure in the bytes of one window read-out; phases: `centroid` and `undistort`.

    The caller charges the transfer of the bytes (``strobe_byte`` each). The published program
    processes each byte as it comes; no step depends on a later one. Raises ValueError unless there
    are `window_bytes` bytes.
    """
    if data.shape != (window_bytes(read_out),):
        raise ValueError(f"a window has {window_bytes(read_out)} bytes, not {data.shape}")
    first = (int(data[0]) + 256 * int(data[1]), int(data[2]) + 256 * int(data[3]))
    origin = read_out.window_origin(*first)
    window = data[COORDINATE_BYTES:].reshape(read_out.window, read_out.window)
    why = codes.Reason
    none = SunResult(codes.DetectResult.SUN_NOT_FOUND)
    with meter.phase("centroid"):
        meter.charge(i16_add=8)
        if first == fpga.SUN_NOT_FOUND and not config.printed:
            return replace(none, reason=why.NO_LIGHT)
        meter.charge(i8=window.size, loop16=read_out.window)
        rows, columns = np.nonzero(window >= config.threshold)
        kept = ~masked(columns + origin[0], rows + origin[1], config.masks, meter)
        rows, columns = rows[kept], columns[kept]
        pixels = len(rows)
        none = replace(none, pixels=pixels)
        if not config.printed and (reason := _no_sun(window, rows, columns, config, meter)):
            return replace(none, reason=reason)
        if not pixels:
            return none
        # The listing's operations per Sun pixel; it converts every factor again.
        meter.charge(f32_convert=4 * pixels, f32_mul=2 * pixels, f32_add=2 * pixels, i16_add=pixels)
        values = window[rows, columns]
        side, axes = read_out.window, ((columns, rows), (rows, columns))
        mean = np.array([_mean(*axis, values, side, config, meter) for axis in axes])
        if config.printed:
            whole = np.subtract(first, config.boresight).astype(np.float32)
            offset = whole + mean - np.subtract(first, origin).astype(np.float32)
        else:
            offset = mean + np.array(origin, np.float32) - np.array(config.boresight, np.float32)
        meter.charge(f32_add=4, f32_div=2, f32_convert=4)
        if not config.printed and _out_of_field(offset, meter):
            return replace(none, reason=why.OUT_OF_FIELD)
    with meter.phase("undistort"):
        centre = config.table.correct(offset[None], meter)[0]
        angle = angle_of(centre, meter)
        meter.charge(i16_add=4)
        if np.abs(angle).max() > _LARGEST_ANGLE:
            return none if config.printed else replace(none, reason=why.OUT_OF_FIELD)
    x, y, alpha, beta = (int(value) for value in (*centre, *angle))
    found = SunResult(codes.DetectResult.SUCCESS, x, y, alpha, beta, pixels=pixels)
    if config.printed:
        return found
    soft = _soft(window, pixels, config, meter)
    sigma = round(100 * (SIGMA_DEG if soft else SHARP_SIGMA_DEG))
    reason = why.MEASURED if soft else why.SHARP
    return replace(found, sigma_alpha=sigma, sigma_beta=sigma, reason=reason)


def _no_sun(
    window: NDArray[np.uint8],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    config: SunConfig,
    meter: Meter,
) -> codes.Reason | None:
    """Why the bright pixels of the window are no Sun; None if they may be one.

    Counted while the window is read: pixels, those at full scale, and limits; columns are scanned
    once more.
    """
    why, pixels = codes.Reason, len(rows)
    meter.charge(i8=5 * window.size + 12 * pixels + 20, i16_add=12)
    if pixels < config.min_pixels:
        return why.NO_LIGHT
    if pixels > config.max_pixels:
        return why.TOO_LARGE
    if 2 * np.count_nonzero(window[rows, columns] == FULL_SCALE) < pixels:
        return why.NOT_SATURATED
    # Rows and columns with two bright pixels: a stuck pixel beside the Sun does not widen it.
    chords = [np.bincount(axis, minlength=window.shape[0]) > 1 for axis in (columns, rows)]
    width, height = (int(np.count_nonzero(chord)) for chord in chords)
    cut = [bool(chord[0] or chord[-1]) for chord in chords]
    if abs(width - height) > ROUND:
        return why.NOT_ROUND
    if not any(cut) and not 13 * width * height <= 20 * pixels <= 20 * (width * height + TIPS):
        return why.NOT_ROUND
    bright = np.zeros(window.shape, bool)
    bright[rows, columns] = True
    return why.NOT_ROUND if _torn(bright) or _torn(bright.T) else None


def _torn(bright: NDArray[np.bool_]) -> bool:
    """Whether a row has two pieces, or two consecutive rows have no common column.

    A single pixel is no piece, and a single missing one is ignored: pixels may be stuck.
    """
    wide = np.pad(bright, ((0, 0), (1, 1)))
    wide[:, 1:-1] |= wide[:, :-2] & wide[:, 2:]
    chords = wide[:, 1:-1] & (wide[:, :-2] | wide[:, 2:])
    starts = np.diff(chords.astype(np.int8), axis=1, prepend=0) == 1
    if (starts.sum(axis=1) > 1).any():
        return True
    chords = chords[chords.any(axis=1)]
    return not bool((chords[:-1] & chords[1:]).any(axis=1).all())


def _soft(window: NDArray[np.uint8], pixels: int, config: SunConfig, meter: Meter) -> bool:
    """Whether the light fades over more than a pixel, as the Sun's image does."""
    meter.charge(i8=2 * window.size, i16_add=2)
    edge = np.count_nonzero((window >= EDGE_LEVEL) & (window < config.threshold))
    return int(edge) ** 2 >= SOFT * pixels


def _out_of_field(offset: NDArray[np.float32], meter: Meter) -> bool:
    """In whole pixels, because the processor multiplies bytes directly."""
    meter.charge(f32_convert=2, i16_add=6)
    across, down = (int(value) for value in offset)
    return across * across + down * down > RIM_PX * RIM_PX


def _mean(
    along: NDArray[np.int64],
    chord: NDArray[np.int64],
    values: NDArray[np.uint8],
    side: int,
    config: SunConfig,
    meter: Meter,
) -> np.float32:
    """Weighted mean of the coordinate ``along``, without cut chords (rows of x, columns of y)."""
    if not config.printed:
        # Each chord's sums are added at its end unless it was cut.
        meter.charge(i8=2 * len(values), f32_add=side, i16_add=side)
        cut = np.unique(chord[(along == 0) | (along == side - 1)])
        whole = ~np.isin(chord, cut)
        if whole.any():
            along, values = along[whole], values[whole]
    weight = values.astype(np.float32)
    moment = sequential_sum(along.astype(np.float32) * weight)
    # A sum of 225 pixels of 255 stays within an int of 16 bits.
    total = np.float32(values.sum(dtype=np.uint16))
    return np.float32(moment / total)
