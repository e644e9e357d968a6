"""What a processor has in the place of an FPGA on a board that has none."""

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

__all__ = ["NoFpga"]


class NoFpga:
    """Keeps time with the processor; it has no pins. Only what a processor calls is here.

    Attributes:
        now_ps: virtual time.
    """

    def __init__(self) -> None:
        """Start at time 0."""
        self.now_ps = 0

    def run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        """Advance to ``until_ps``; there is nothing that could stop it."""
        del stop_on
        self.now_ps = until_ps
        return self.now_ps

    def set_pin(self, name: str, value: int) -> None:
        """Refuse a pin; ValueError."""
        del value
        raise _nothing(name)

    def get_pin(self, name: str) -> int:
        """Refuse a pin; ValueError."""
        raise _nothing(name)

    def strobe_read(self, out: NDArray[np.uint8], period: Fraction, until_ps: int) -> int:
        """Refuse to read; ValueError."""
        del out, period, until_ps
        raise _nothing("DATA")


def _nothing(pin: str) -> ValueError:
    return ValueError(f"this board has no FPGA, so it has no pin {pin}")
