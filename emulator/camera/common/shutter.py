"""Timing of a rolling shutter.

CubeStar thesis, appendix C (figure C.1): rows are read out one line time apart, and each is exposed
for the same number of line times before its readout.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from cubestack.emulator.sim.virtual_time import PS_PER_S


@dataclass(frozen=True)
class RollingShutter:
    """One frame's exposure: row r is exposed in the ``exposure_lines`` before its readout."""

    readout_ps: int  # time at which row 0 is read out; row r follows r line times later
    line_ps: Fraction  # one line time in ps, exact
    exposure_lines: int  # exposure in line times
    # exposure set in the registers; it differs only in the undefined frame after the sensor was
    # enabled
    programmed_lines: int

    @cached_property
    def exposure_s(self) -> float:
        return float(self.exposure_lines * self.line_ps / PS_PER_S)

    @cached_property
    def line_s(self) -> float:
        return float(self.line_ps / PS_PER_S)

    @property
    def relative_exposure(self) -> float:
        """Exposure divided by the programmed one."""
        return self.exposure_lines / self.programmed_lines

    def mid_exposure_ps(self, row: float) -> int:
        """Middle of the exposure of ``row``, counted from 0; may be fractional."""
        lines = Fraction(row) - Fraction(self.exposure_lines, 2)
        return self.readout_ps + round(lines * self.line_ps)
