"""What boards, faults and hosts use of a microcontroller, whatever runs on it."""

from typing import Protocol

from cubestack.emulator.sim.fpga_port import FpgaPort


class Microcontroller(Protocol):
    """A processor in virtual time.

    Attributes:
        fpga: what it has at its pins to the FPGA; a fault may stand before it. None without one.
        resets: number of resets since power-up.
        waiting: nothing happens until somebody outside does something.
        dozing: it sleeps, with or without a deadline.
    """

    resets: int

    @property
    def fpga(self) -> FpgaPort | None:
        """See above."""

    @fpga.setter
    def fpga(self, fpga: FpgaPort | None) -> None: ...

    @property
    def waiting(self) -> bool:
        """See above."""

    @property
    def dozing(self) -> bool:
        """See above."""

    def wake(self) -> None:
        """Something happened that an interrupt tells of: one that sleeps looks at it."""

    def reset(self, cause: int, hang_us: int = 0) -> None:
        """Reset for a reason; ``hang_us``: after the program has hung for so long."""
