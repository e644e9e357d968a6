"""Detection where the sky's brightness changes within a cell: at the Earth's limb, near the Moon.

There a level interpolated between cells is wrong by more than the brightness of stars. A pixel is
compared with the middles of the lines between pixels on opposite sides instead, along the row, the
column and both diagonals: on a slope all agree, along an edge one does, and only a spot exceeds
them all. The row is in memory already; the other directions are read for what exceeds it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection.spots import ELECTRONS_PER_DN, HALF, SATURATED_DN
from cubestack.firmware_model.mcu.inner_loops import BYTES, FLOAT, INT, INTS, MARKS, Loop
from cubestack.firmware_model.star_tracker.background import CELL, UNIT, Ints, Marks, SkyBackground

#: Range of a cell and its eight neighbours from which on it is steep, in DN and in times the noise
#: of a pixel; chosen.
STEEP_DN, STEEP_SIGMAS = 12, 4

SIGMAS = 4  #: of the noise by which a pixel stands out
BLIND_DN = 160  #: level of a cell of which more than half is at the end of the scale; chosen
REACH = HALF + 1  #: distance of the pixels compared with: beyond a spot

#: That are looked at in all directions: they take 20 ms. The Earth's limb across the picture has up
#: to 8000; those below are not searched.
MOST_PLACES = 10_000

_ALONG_ROWS = Loop("steep_along_rows", BYTES, MARKS, *[INT] * 5, FLOAT, INT, INT, INT, INTS, INT)

_OTHER_WAYS = REACH * np.array([[-1, 0], [1, 0], [-1, -1], [1, 1], [-1, 1], [1, -1]])


@dataclass(frozen=True, eq=False)
class Places:
    """Places (n,) of a region by row and column, level (whole DN) and noise there in 1/16 DN."""

    rows: Ints
    columns: Ints
    levels: Ints
    noises: Ints

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, which: Marks | slice) -> "Places":
        return Places(self.rows[which], self.columns[which], self.levels[which], self.noises[which])


def steep(sky: SkyBackground, height: int, width: int) -> Marks:
    """Which pixels (height, width) are in a cell that differs from one of its neighbours."""
    padded = np.pad(sky.levels, 1, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    most = max(STEEP_DN * UNIT, STEEP_SIGMAS * int(np.median(sky.noises)))
    cells = (np.ptp(around, axis=(2, 3)) > most) & (sky.levels < SATURATED_DN * UNIT)
    marks: Marks = np.repeat(np.repeat(cells, CELL, axis=0), CELL, axis=1)[:height, :width]
    return marks


def along_rows(picture: NDArray[np.uint8], marks: Marks, sky: SkyBackground, least: int) -> Places:
    """Marked pixels that exceed their row by ``least`` (1/16 DN) at least."""
    if _ALONG_ROWS:
        most = int(np.count_nonzero(marks))
        places = np.empty((4, most), np.int64)
        limits = SIGMAS, ELECTRONS_PER_DN, BLIND_DN * UNIT, int(np.median(sky.noises)), least
        pictures = np.ascontiguousarray(picture), np.ascontiguousarray(marks)
        found = _ALONG_ROWS(*pictures, *picture.shape, REACH, UNIT, *limits, places, most)
        return Places(*places[:, :found])
    rows, columns = np.nonzero(marks)
    last = picture.shape[1] - 1
    one = picture[rows, np.maximum(columns - REACH, 0)].astype(np.int64)
    other = picture[rows, np.minimum(columns + REACH, last)].astype(np.int64)
    levels = (one + other + 1) // 2 * UNIT
    return _standing_out(picture, Places(rows, columns, levels, levels), sky, least)


def beside(places: Places, height: int, width: int) -> tuple[Ints, Ints]:
    """Rows and columns (6, n) of the pixels in the other directions, or at the border."""
    rows = np.clip(places.rows + _OTHER_WAYS[:, :1], 0, height - 1)
    columns = np.clip(places.columns + _OTHER_WAYS[:, 1:], 0, width - 1)
    return rows, columns


def all_ways(
    picture: NDArray[np.uint8],
    places: Places,
    beside: NDArray[np.uint8],
    sky: SkyBackground,
    least: int,
) -> Places:
    """Which places exceed the pixels ``beside`` (6 n,) too."""
    pairs = beside.reshape(3, 2, -1).sum(axis=1, dtype=np.int64)
    levels = np.maximum(places.levels, (pairs.max(axis=0, initial=0) + 1) // 2 * UNIT)
    return _standing_out(picture, Places(places.rows, places.columns, levels, levels), sky, least)


def _standing_out(
    picture: NDArray[np.uint8], places: Places, sky: SkyBackground, least: int
) -> Places:
    """Places that exceed their level by four times the noise of the sky and of its light, where
    that is not so bright that the end of the scale looks like an edge."""
    dark = int(np.median(sky.noises))
    light = UNIT * places.levels / ELECTRONS_PER_DN
    noises = np.sqrt(1.5 * (dark * dark + light)).astype(np.int64)
    signal = UNIT * picture[places.rows, places.columns].astype(np.int64) - places.levels
    found = Places(places.rows, places.columns, places.levels, noises)
    seen = (signal > np.maximum(SIGMAS * noises, least)) & (places.levels < BLIND_DN * UNIT)
    return found[seen]


@dataclass(frozen=True, eq=False)
class LocalBackground:
    """Level and noise of the sky, on slopes as the places there have it."""

    cells: SkyBackground
    slopes: Marks
    places: Places

    def at(self, rows: Ints, columns: Ints) -> tuple[Ints, Ints]:
        """Levels and noises (n,) of bright pixels."""
        cells, places, width = self.cells, self.places, self.slopes.shape[1]
        levels = cells.interpolated(cells.levels, rows, columns)
        noises = cells.interpolated(cells.noises, rows, columns)
        if not len(places):
            return levels, noises
        known, wanted = places.rows * width + places.columns, rows * width + columns
        found = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
        on_slope = known[found] == wanted
        return (
            np.where(on_slope, places.levels[found], levels),
            np.where(on_slope, places.noises[found], noises),
        )

    def under(self, windows: Ints, y: Ints, x: Ints, on_slope: Marks) -> Ints:
        """Levels of windows (n, 9, 9) at rows and columns, broadcast: ``on_slope`` (n,) the plane
        through their outermost pixels."""
        levels = self.cells.interpolated(self.cells.levels, y, x)
        levels[on_slope] = _planes(UNIT * windows[on_slope])
        return levels


def _planes(windows: Ints) -> Ints:
    top, bottom = windows[:, 0].mean(axis=1), windows[:, -1].mean(axis=1)
    left, right = windows[:, :, 0].mean(axis=1), windows[:, :, -1].mean(axis=1)
    away = np.arange(-HALF, HALF + 1) / (2 * HALF)
    levels = ((top + bottom + left + right) / 4)[:, None, None]
    levels = levels + (bottom - top)[:, None, None] * away[:, None]
    levels = levels + (right - left)[:, None, None] * away
    rounded: Ints = np.rint(levels).astype(np.int64)
    return rounded
