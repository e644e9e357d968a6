"""A camera's parallel output: segments with a continuous pixel clock, and the clock's edges.

Pixel data, HSync and VSync change with the falling edge of the pixel clock and are valid at its
rising edge (CubeStar thesis, appendix C).
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.sim.virtual_time import PS_PER_S


@dataclass(frozen=True)
class StreamSegment:
    """A ``rtl.pixel_clock.PixelSegment``: blanking, or whole lines.

    Each line begins with its active columns, while HSync is high.
    """

    start_ps: int
    clocks: int
    vsync: int
    rows: int
    pixels: Callable[[], NDArray[np.uint8]] | None


@dataclass(frozen=True)
class PixelClock:
    """A free-running clock: rising edge k is at floor(origin + k * period)."""

    hz: int
    origin_ps: int = 0

    def __post_init__(self) -> None:
        if self.hz <= 0:
            raise ValueError(f"a pixel clock needs a positive frequency, not {self.hz} Hz")

    @property
    def period(self) -> Fraction:
        return Fraction(PS_PER_S, self.hz)

    def edge_ps(self, k: int) -> int:
        return self.origin_ps + k * PS_PER_S // self.hz

    def end_ps(self, first: int, clocks: int) -> int:
        """End of ``clocks`` clocks for a consumer that counts from edge ``first``."""
        return self.edge_ps(first) + clocks * PS_PER_S // self.hz

    def first_edge(self, time_ps: int) -> int:
        """Number of the first rising edge at ``time_ps`` or later."""
        # floor(k * period) >= t exactly when k * period >= t, because t is an integer.
        return max(0, -(-(time_ps - self.origin_ps) * self.hz // PS_PER_S))
