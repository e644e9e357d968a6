"""The interface of a microcontroller to boards, faults and hosts, for any kind of program."""

from typing import Protocol

from cubestack.emulator.sim.fpga_port import FpgaPort


class Microcontroller(Protocol):
    """A processor in virtual time.

    Attributes:
        fpga: the FPGA at its pins, or a fault in front of it; None on a board without.
        resets: number of resets since power-up.
        waiting: nothing happens without input from outside.
        dozing: it sleeps, with or without a deadline.
    """

    resets: int

    @property
    def fpga(self) -> FpgaPort | None: ...

    @fpga.setter
    def fpga(self, fpga: FpgaPort | None) -> None: ...

    @property
    def waiting(self) -> bool: ...

    @property
    def dozing(self) -> bool: ...

    def wake(self) -> None:
        """An interrupt is pending: if it sleeps, it wakes."""

    def reset(self, cause: int, hang_us: int = 0) -> None:
        """Reset with ``cause``, after the program has hung for ``hang_us``."""
