"""Segments of a camera's output, and the edges of their pixel clock.

Edge k of a segment is at floor(start + k * period / 2): even edges rise, odd ones fall. Rising
edge 2n samples pixel n, which is on the lines since the falling edge before.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class PixelSegment(Protocol):
    """A part of the camera's output with a continuous pixel clock: blanking, or whole lines."""

    @property
    def start_ps(self) -> int:
        """First rising edge of the clock; rising edge n is at floor(start_ps + n * period)."""

    @property
    def clocks(self) -> int: ...

    @property
    def vsync(self) -> int:
        """Level of the frame pin in the whole segment, if the pin is wired."""

    @property
    def rows(self) -> int:
        """Number of lines; 0 is blanking, with the line pin low throughout.

        Otherwise ``clocks`` is ``rows * line_clocks``, and the line pin is high in the first
        ``active_columns`` clocks of each line.
        """

    @property
    def pixels(self) -> Callable[[], NDArray[np.uint8]] | None:
        """Renders the lines: shape (rows, active_columns), uint8, C-contiguous.

        Called only if the FPGA may store them, once per segment returned by ``segment_at``.
        """


class PixelSource(Protocol):
    """The camera's parallel output; data and syncs change with the falling edge of the clock."""

    @property
    def period(self) -> Fraction: ...

    @property
    def line_clocks(self) -> int:
        """Clocks per line, including those with the line pin low."""

    @property
    def active_columns(self) -> int:
        """Clocks per line with the line pin high."""

    def segment_at(self, time_ps: int) -> PixelSegment | None:
        """Segment whose clocks contain ``time_ps``; None without a pixel clock at that time.

        After None, the engine calls again only after ``stream_changed``.
        """


@dataclass
class LoadedSegment:
    """A segment with its source's clock and line lengths."""

    segment: PixelSegment
    half_period: Fraction  # time between a rising and a falling edge in ps
    line_clocks: int
    active_columns: int
    pixels: NDArray[np.uint8] | None = None  # the rendered lines; None before that

    @classmethod
    def of(cls, source: PixelSource, segment: PixelSegment) -> "LoadedSegment":
        """Load ``segment`` of ``source``; ValueError for inconsistent lengths."""
        if segment.rows and segment.clocks != segment.rows * source.line_clocks:
            raise ValueError(
                f"a segment of {segment.rows} rows of {source.line_clocks} clocks has "
                f"{segment.rows * source.line_clocks} clocks, not {segment.clocks}"
            )
        if segment.clocks <= 0:
            raise ValueError(f"a segment needs at least one clock, not {segment.clocks}")
        return cls(segment, source.period / 2, source.line_clocks, source.active_columns)

    @property
    def edges(self) -> int:
        return 2 * self.segment.clocks

    @property
    def end_ps(self) -> int:
        """Time of the first rising edge of a segment that follows without a gap."""
        return self.time_of(self.edges)

    def time_of(self, edge: int) -> int:
        return self.segment.start_ps + int(edge * self.half_period)

    def first_edge(self, time_ps: int) -> int:
        """First edge at ``time_ps`` or later; ``edges`` if there is none."""
        # floor(k * h) >= d exactly when k * h >= d, because d is an integer.
        edge = ceil((time_ps - self.segment.start_ps) / self.half_period)
        return min(max(edge, 0), self.edges)

    def sample(self, n: int) -> tuple[int, int]:
        """HSYNC and PIXDATA of sample ``n``; pixels that are not rendered are 0."""
        row, column = divmod(n, self.line_clocks)
        if not self.segment.rows or column >= self.active_columns:
            return 0, 0
        return 1, 0 if self.pixels is None else int(self.pixels[row, column])

    def low_until(self, n: int) -> int:
        """Number of the sample after the low run of HSYNC that contains sample ``n``."""
        if not self.segment.rows:
            return self.segment.clocks
        return (n // self.line_clocks + 1) * self.line_clocks

    def render(self) -> NDArray[np.uint8]:
        """Render the lines, and keep them; ValueError for another shape or type."""
        shape = (self.segment.rows, self.active_columns)
        if self.segment.pixels is None:
            raise ValueError(f"a segment of {self.segment.rows} rows needs pixels")
        pixels = self.segment.pixels()
        if pixels.dtype != np.uint8 or pixels.shape != shape or not pixels.flags.c_contiguous:
            raise ValueError(
                f"pixels must be C-contiguous uint8 of shape {shape}, "
                f"not {pixels.dtype} of shape {pixels.shape}"
            )
        self.pixels = pixels
        return pixels
