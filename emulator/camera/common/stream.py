"""What a camera's parallel output is made of: segments of an unbroken pixel clock, and its grid.

Pixel data, HSync and VSync change with the falling edge of the pixel clock and are good at its
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
    """A stretch of the output: blanking, or whole lines.

    Attributes:
        start_ps: first rising edge of the pixel clock.
        clocks: number of pixel clocks; ``rows`` times the clocks of a line unless it is blanking.
        vsync: level of VSync throughout.
        rows: number of lines, each beginning with its active columns under a high HSync; 0 is
            blanking, with HSync low throughout.
        pixels: renders the lines, shape (rows, active columns), uint8, C-contiguous; None in
            blanking.
    """

    start_ps: int
    clocks: int
    vsync: int
    rows: int
    pixels: Callable[[], NDArray[np.uint8]] | None


@dataclass(frozen=True)
class PixelClock:
    """A free-running clock: rising edge k is at floor(origin + k * period).

    Attributes:
        hz: frequency.
        origin_ps: time of edge 0.
    """

    hz: int
    origin_ps: int = 0

    def __post_init__(self) -> None:
        """Refuse a frequency that is not positive."""
        if self.hz <= 0:
            raise ValueError(f"a pixel clock needs a positive frequency, not {self.hz} Hz")

    @property
    def period(self) -> Fraction:
        """Time of one clock in ps, exact."""
        return Fraction(PS_PER_S, self.hz)

    def edge_ps(self, k: int) -> int:
        """Time of rising edge ``k``."""
        return self.origin_ps + k * PS_PER_S // self.hz

    def end_ps(self, first: int, clocks: int) -> int:
        """Where a consumer that counts ``clocks`` from edge ``first`` sees their end."""
        return self.edge_ps(first) + clocks * PS_PER_S // self.hz

    def first_edge(self, time_ps: int) -> int:
        """Number of the first rising edge at ``time_ps`` or later."""
        # floor(k * period) >= t exactly when k * period >= t, because t is an integer.
        return max(0, -(-(time_ps - self.origin_ps) * self.hz // PS_PER_S))
