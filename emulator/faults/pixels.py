"""Faults of a camera's output: a source of pixels in place of the camera.

A line with a missing or additional clock is sent as separate segments, so that the FPGA receives
exactly the edges of real hardware. At most one of these faults hits a line.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.image_sensor import StreamSegment
from cubestack.emulator.faults import table
from cubestack.emulator.faults.injection import Injection, Report, active
from cubestack.emulator.rtl.pixel_clock import PixelSegment, PixelSource

Picture = NDArray[np.uint8]

_CLOCK_FAULTS = (table.ClockLost, table.ClockExtra, table.LineMissing)
_PIXEL_FAULTS = (table.PixelHot, table.PixelDead, table.ColumnDefect, table.Blooming)


@dataclass(frozen=True)
class _Piece(StreamSegment):
    """A segment with its own clock and line lengths; see PixelSource."""

    period: Fraction
    line_clocks: int
    active_columns: int

    @property
    def end_ps(self) -> int:
        return self.start_ps + int(self.clocks * self.period)


class _Hit(NamedTuple):
    """A fault of the clocks in one line."""

    row: int
    column: int
    injection: Injection


class FaultySource:
    """The output of ``source`` with faults.

    Attributes:
        period, line_clocks, active_columns: those of the latest segment.
        injections: present and future faults.
    """

    def __init__(self, source: PixelSource, report: Report, injections: list[Injection]) -> None:
        self._source = source
        self._report = report
        self.injections = injections
        self.period = source.period
        self.line_clocks = source.line_clocks
        self.active_columns = source.active_columns
        self._cache: tuple[tuple[object, ...], list[_Piece]] | None = None

    def segment_at(self, time_ps: int) -> PixelSegment | None:
        """The source's segment, split at a missing or additional clock."""
        if active(self.injections, table.CameraDead, time_ps):
            return None
        base = self._source.segment_at(time_ps)
        self.period = self._source.period
        self.line_clocks = self._source.line_clocks
        self.active_columns = self._source.active_columns
        if base is None or not base.rows or not self.injections:
            return base
        key = (
            *(base.start_ps, base.clocks, self.line_clocks, self.active_columns, self.period),
            *((injection.number, injection.end_ps) for injection in self.injections),
        )
        if self._cache is None or self._cache[0] != key:
            self._cache = key, self._pieces(base)
        for piece in self._cache[1]:
            if piece.end_ps > time_ps:
                self.period = piece.period
                self.line_clocks = piece.line_clocks
                self.active_columns = piece.active_columns
                return piece
        # The start of a piece is rounded down, so its end may be 1 ps early.
        return self.segment_at(base.start_ps + int(base.clocks * self._source.period))

    # --- pixels ---------------------------------------------------------------------------------

    def _with_faults(self, base: PixelSegment, hits: list[_Hit]) -> Callable[[], Picture]:
        """Renders the image with its faults, once; reports them only when it is rendered."""
        rendered: list[Picture] = []
        line_ps = self.line_clocks * self.period

        def render() -> Picture:
            if rendered:
                return rendered[0]
            assert base.pixels is not None
            picture = base.pixels().copy()
            for injection in self.injections:
                if isinstance(injection.fault, _PIXEL_FAULTS):
                    lines = _lines(injection, base.start_ps, line_ps, base.rows)
                    if lines:
                        text = _apply(picture, lines, injection)
                        self._report(base.start_ps + int(lines.start * line_ps), injection, text)
            for row, column, injection in hits:
                line = isinstance(injection.fault, table.LineMissing)
                place = f"line {row}" if line else f"line {row}, column {column}"
                self._report(base.start_ps + int(row * line_ps), injection, place)
            rendered.append(picture)
            return picture

        return render

    # --- clocks ---------------------------------------------------------------------------------

    def _hits(self, base: PixelSegment) -> list[_Hit]:
        """Faults of the clocks in this frame, ordered by line."""
        hits: dict[int, _Hit] = {}
        for injection in self.injections:
            fault = injection.fault
            if not isinstance(fault, _CLOCK_FAULTS) or not injection.active(base.start_ps):
                continue
            # By frame time, so that a frame's faults do not depend on earlier frames.
            key = base.start_ps
            if float(injection.generator_at(key).random()) >= fault.rate:
                continue
            row = injection.draw(fault.row, base.rows, key, 1)
            column = 0
            if not isinstance(fault, table.LineMissing):
                column = injection.draw(fault.column, self.active_columns, key, 2)
            hits.setdefault(row, _Hit(row, column, injection))
        return sorted(hits.values())

    def _pieces(self, base: PixelSegment) -> list[_Piece]:
        hits = self._hits(base)
        full = self._with_faults(base, hits)
        pieces: list[_Piece] = []
        clocks, columns, period = self.line_clocks, self.active_columns, self.period

        def put(
            first: int,
            count: int,
            rows: slice | None = None,
            part: slice = slice(None),
            step: Fraction = period,
            repeat: int = 1,
        ) -> None:
            """Add ``count`` clocks from clock ``first`` on, with columns ``part`` of ``rows``."""
            if count <= 0:
                return
            start_ps = base.start_ps + int(first * period)
            if rows is None:
                piece = _Piece(start_ps, count, base.vsync, 0, None, step, count, 0)
            else:
                number = rows.stop - rows.start
                width = len(range(*part.indices(columns))) * repeat

                def pixels() -> Picture:
                    return np.ascontiguousarray(np.repeat(full()[rows, part], repeat, axis=1))

                piece = _Piece(
                    start_ps, count, base.vsync, number, pixels, step, count // number, width
                )
            pieces.append(piece)

        done = 0
        for row, column, injection in hits:
            first = row * clocks
            put(done * clocks, (row - done) * clocks, slice(done, row))
            one = slice(row, row + 1)
            if isinstance(injection.fault, table.LineMissing):
                put(first, clocks)
            else:
                put(first, column, one, slice(0, column))
                if isinstance(injection.fault, table.ClockExtra):
                    twice = slice(column, column + 1)
                    put(first + column, 2, one, twice, step=period / 2, repeat=2)
                rest = slice(column + 1, columns)
                lines = one if column + 1 < columns else None
                put(first + column + 1, clocks - column - 1, lines, rest)
            done = row + 1
        put(done * clocks, (base.rows - done) * clocks, slice(done, base.rows))
        return pieces


def _lines(injection: Injection, start_ps: int, line_ps: Fraction, rows: int) -> range:
    """Lines that are read out while a fault is active."""

    def first_row_from(time_ps: int) -> int:
        return min(max(-((start_ps - time_ps) // line_ps), 0), rows)

    end = rows if injection.end_ps is None else first_row_from(injection.end_ps)
    return range(first_row_from(injection.start_ps), end)


def _apply(picture: Picture, lines: range, injection: Injection) -> str:
    """Apply a fault to some lines of ``picture``; returns a text for the log."""
    height, width = picture.shape
    fault = injection.fault
    match fault:
        case table.PixelHot() | table.PixelDead():
            x, y = injection.draw(fault.x, width, 1), injection.draw(fault.y, height, 2)
            if y in lines:
                picture[y, x] = fault.level if isinstance(fault, table.PixelHot) else 0
            return f"pixel ({x}, {y})"
        case table.ColumnDefect():
            x = injection.draw(fault.x, width, 1)
            picture[lines.start : lines.stop, x] = fault.level
            return f"column {x}"
        case table.Blooming():
            bright = picture[lines.start : lines.stop] >= fault.threshold
            spilled = bright.copy()
            for shift in range(1, min(fault.length, len(lines) - 1) + 1):
                spilled[shift:] |= bright[:-shift]
                spilled[:-shift] |= bright[shift:]
            picture[lines.start : lines.stop][spilled] = 255
            return f"{int(bright.sum())} bright pixels spill"
    raise AssertionError(fault)
