"""A camera that repeats one frame, for benchmarks of engines."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from math import ceil

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class _Segment:
    """Blanking, or all lines of the image."""

    start_ps: int
    clocks: int
    rows: int
    pixels: Callable[[], NDArray[np.uint8]] | None
    vsync: int = 1


@dataclass(frozen=True)
class RepeatedFrame:
    """A :class:`~cubestack.emulator.rtl.pixel_clock.PixelSource`: blanking, then the image."""

    image: NDArray[np.uint8]  # (rows, columns)
    period: Fraction  # period of the pixel clock in ps
    line_clocks: int  # clocks from one line to the next
    blank_clocks: int = 0  # clocks before the first line

    @property
    def active_columns(self) -> int:
        return len(self.image[0])

    @property
    def clocks(self) -> int:
        return self.blank_clocks + len(self.image) * self.line_clocks

    def segment_at(self, time_ps: int) -> _Segment:
        # The last frame that begins at this time or before, its start rounded down.
        first = (ceil((time_ps + 1) / (self.clocks * self.period)) - 1) * self.clocks
        image_ps = int((first + self.blank_clocks) * self.period)
        if time_ps < image_ps:
            return _Segment(int(first * self.period), self.blank_clocks, 0, None)
        lines = len(self.image)
        return _Segment(image_ps, lines * self.line_clocks, lines, lambda: self.image)
