"""A microcontroller's connection to an FPGA, and its interface to boards, faults and hosts.

The connection has lines, a data clock, an external bus.

A transaction on the bus has the phases of :mod:`cubestack.firmware_model.mcu.external_bus`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.external_bus import EBI, BusTiming

STEPS = 6
"""Events of a transaction: latch opens, latch closes, select, strobe falls, strobe rises, release.
"""

TAKE = 4
"""A read samples its byte right before this event."""


@dataclass(frozen=True)
class Transactions:
    """Consecutive reads or writes."""

    addresses: NDArray[np.int32]  # (n,) int32, C-contiguous, of 24 bits each
    # (n,) uint8, C-contiguous: the bytes to write, or the destination of the bytes read
    data: NDArray[np.uint8]
    write: bool
    cycle: Fraction  # period of the core clock in ps
    cycles: int  # core cycles from the start of one transaction to that of the next
    select: int = 0  # number of the chip select
    above: int = 255  # the first byte read that is larger ends the sequence
    timing: BusTiming = EBI  # phases of a transaction

    def __post_init__(self) -> None:
        for array, kind in ((self.addresses, np.int32), (self.data, np.uint8)):
            if array.dtype != kind or array.ndim != 1 or not array.flags.c_contiguous:
                raise ValueError(f"transactions need contiguous {kind.__name__}, not {array!r}")
        if len(self.addresses) != len(self.data):
            counts = f"{len(self.addresses)} addresses have {len(self.data)} bytes"
            raise ValueError(f"{counts}: one each is needed")
        if self.cycles < self.timing.cycles:
            raise ValueError(f"a transaction takes {self.timing.cycles} cycles, not {self.cycles}")

    def __len__(self) -> int:
        return len(self.addresses)

    def first(self, count: int) -> "Transactions":
        return replace(self, addresses=self.addresses[:count], data=self.data[:count])

    @property
    def period(self) -> Fraction:
        """Time from one transaction to the next in ps."""
        return self.cycle * self.cycles

    @cached_property
    def offsets(self) -> tuple[int, ...]:
        """Core cycle of each event within a transaction."""
        timing = self.timing
        phases = (timing.address_setup, timing.address_hold, timing.setup, timing.strobe)
        closes, selects, falls, rises = np.cumsum(phases).tolist()
        return (0, closes, selects, falls, rises, rises + timing.hold)

    def time_of(self, event: int) -> int:
        """Time of ``event``, counted over all transactions, in ps from the first one's start."""
        index, step = divmod(event, STEPS)
        return int(self.cycle * (index * self.cycles + self.offsets[step]))


class Driver(NamedTuple):
    """C functions of compiled FPGAs, for other compiled code to call."""

    handle: int  # first argument of the functions
    # addresses of the functions
    set: int
    get: int
    burst: int
    pins: Mapping[str, int]  # number of each pin


class FpgaPort(Protocol):
    """FPGAs as the microcontroller sees them. Only the last three methods advance time."""

    @property
    def now_ps(self) -> int:
        """Virtual time, which may be ahead of the kernel's."""

    @property
    def running(self) -> int:
        """Cameras whose pixel clock runs now, one bit each; without them, time changes nothing."""

    @property
    def driver(self) -> Driver | None:
        """The FPGAs' C functions; None if they are not compiled, or a fault is at their pins.

        Before a call, the caller runs the bursts of all ``running`` cameras up to its time, and
        passes a burst that ends early to ``attend``.
        """

    def attend(self, reached_ps: int, end: int, camera: int, until_ps: int) -> int:
        """Handle the ``end`` of a burst of ``driver``, up to ``until_ps``; returns ``running``."""

    def set_pin(self, name: str, value: int) -> None:
        """Drive an output of the microcontroller from ``now_ps`` on; ValueError for others."""

    def get_pin(self, name: str) -> int:
        """Settled level at ``now_ps`` of any input or output pin.

        Clocks that change nothing may have been skipped. This shows only in a memory's D_O while
        its D_OE is low.
        """

    def run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        """Advance to ``until_ps``, pixel clock edges at that very instant included.

        ``stop_on`` is an acknowledge pin and a level: stop right after the edge that sets it to
        that level, or at once when it has it already; edges of later cameras at that instant then
        remain. Returns ``now_ps``; ValueError for a time in the past.
        """

    def strobe_read(self, out: NDArray[np.uint8], period: Fraction, until_ps: int) -> int:
        """Run the microcontroller's transfer loop from ``now_ps``.

        In each cycle of ``period`` ps, the data clock rises, the data pins are sampled into ``out``
        after half the period, and the clock falls. Only cycles that end by ``until_ps`` run.
        Returns their number n; ``now_ps`` advances by floor(n * period). The fraction cut off there
        is kept for a burst of the same period that follows at once, so bursts do not drift.
        """

    def access(self, transactions: Transactions, until_ps: int) -> int:
        """Perform transactions on the microcontroller's external bus from ``now_ps``.

        A read that nothing answers returns the level that the lines kept: address bits 15..8. Only
        transactions that end by ``until_ps`` run. Returns their number n; ``now_ps`` advances by
        floor(n * period). ValueError for a design without that bus.
        """


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
