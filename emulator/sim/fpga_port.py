"""What a microcontroller has at its pins to an FPGA: lines, a data clock, an external bus.

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
"""The event at which a read takes its byte, right before it."""


@dataclass(frozen=True)
class Transactions:
    """Reads, or writes, one after the other.

    Attributes:
        addresses: (n,) int32, C-contiguous, of 24 bits each.
        data: (n,) uint8, C-contiguous: the bytes to be written, or where the bytes read go.
        write: to write them.
        cycle: of the core clock, in ps.
        cycles: from the start of one transaction to that of the next.
        select: number of the chip select.
        above: a byte read that is above it ends the whole.
        timing: phases of a transaction.
    """

    addresses: NDArray[np.int32]
    data: NDArray[np.uint8]
    write: bool
    cycle: Fraction
    cycles: int
    select: int = 0
    above: int = 255
    timing: BusTiming = EBI

    def __post_init__(self) -> None:
        """Refuse what can not be: ValueError."""
        for array, kind in ((self.addresses, np.int32), (self.data, np.uint8)):
            if array.dtype != kind or array.ndim != 1 or not array.flags.c_contiguous:
                raise ValueError(f"transactions need contiguous {kind.__name__}, not {array!r}")
        if len(self.addresses) != len(self.data):
            counts = f"{len(self.addresses)} addresses have {len(self.data)} bytes"
            raise ValueError(f"{counts}: one each is needed")
        if self.cycles < self.timing.cycles:
            raise ValueError(f"a transaction takes {self.timing.cycles} cycles, not {self.cycles}")

    def __len__(self) -> int:
        """How many there are."""
        return len(self.addresses)

    def first(self, count: int) -> "Transactions":
        """The first ``count``; a live view."""
        return replace(self, addresses=self.addresses[:count], data=self.data[:count])

    @property
    def period(self) -> Fraction:
        """From one to the next in ps."""
        return self.cycle * self.cycles

    @cached_property
    def offsets(self) -> tuple[int, ...]:
        """Cycle of each event within a transaction."""
        timing = self.timing
        phases = (timing.address_setup, timing.address_hold, timing.setup, timing.strobe)
        closes, selects, falls, rises = np.cumsum(phases).tolist()
        return (0, closes, selects, falls, rises, rises + timing.hold)

    def time_of(self, event: int) -> int:
        """Time of ``event``, counted over all transactions, in ps from the first one's start."""
        index, step = divmod(event, STEPS)
        return int(self.cycle * (index * self.cycles + self.offsets[step]))


class Driver(NamedTuple):
    """Compiled FPGAs' own functions, for compiled code that stands at their pins.

    Attributes:
        handle: first argument of the functions.
        set, get, burst: their addresses.
        pins: number of each pin.
    """

    handle: int
    set: int
    get: int
    burst: int
    pins: Mapping[str, int]


class FpgaPort(Protocol):
    """FPGAs as the microcontroller reaches them. Time only moves in the last three calls."""

    @property
    def now_ps(self) -> int:
        """Virtual time, which may be ahead of the kernel's."""

    @property
    def running(self) -> int:
        """Cameras whose clocks are made now, one bit each; other time changes nothing."""

    @property
    def driver(self) -> Driver | None:
        """The FPGAs' own functions, where they are compiled and nothing stands before them.

        Who calls them at a time does so after the bursts of ``running`` up to it, and hands a
        burst that ends otherwise to ``attend``.
        """

    def attend(self, reached_ps: int, end: int, camera: int, until_ps: int) -> int:
        """A burst of ``driver`` ended so; does what is due, up to ``until_ps``; ``running``."""

    def set_pin(self, name: str, value: int) -> None:
        """Drive one of the microcontroller's outputs from ``now_ps`` on; ValueError for others."""

    def get_pin(self, name: str) -> int:
        """Settled level at ``now_ps`` of any input or output pin.

        Clocks that change nothing may have been skipped. The one trace that leaves is in a memory's
        D_O while its D_OE is low.
        """

    def run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        """Advance to ``until_ps``, pixel clock edges at that very instant included.

        ``stop_on`` is an acknowledge and a level: stop right after the edge that brings it to that
        level, or at once when it is there already; later cameras' edges at that instant are then
        still to come. Returns ``now_ps``; ValueError for a time in the past.
        """

    def strobe_read(self, out: NDArray[np.uint8], period: Fraction, until_ps: int) -> int:
        """Run the microcontroller's transfer loop from ``now_ps``.

        In each cycle of ``period`` ps, the data clock rises, the data pins are taken into ``out``
        after half the period, and the clock falls. Only cycles that end by ``until_ps`` are made.
        Returns how many, n; ``now_ps`` advances by floor(n * period). The fraction cut off there is
        kept for a burst of the same period that follows at once, so that bursts do not drift.
        """

    def access(self, transactions: Transactions, until_ps: int) -> int:
        """Make transactions on the microcontroller's external bus from ``now_ps``.

        A read of which no byte comes back takes what the lines kept: address bits 15..8. Only
        transactions that end by ``until_ps`` are made. Returns how many, n; ``now_ps`` advances by
        floor(n * period). ValueError for a design without that bus.
        """
