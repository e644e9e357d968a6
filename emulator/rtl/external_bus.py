"""A microcontroller's transactions on its external bus, as levels of lines at times.

The order of events is that of ``docs/gateware-cubestar-next.md``; the phases between them are those
of :mod:`cubestack.firmware_model.mcu.external_bus`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.wiring import BusPins
from cubestack.firmware_model.mcu.external_bus import EBI, BusTiming

__all__ = ["STEPS", "TAKE", "Transactions"]

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

    def levels(self, pins: BusPins, event: int) -> Sequence[tuple[str, int]]:
        """What the microcontroller's lines go to at ``event``.

        It drives the lower lines while they carry an address, or a byte to be written; after that
        they keep their level.
        """
        index, step = divmod(event, STEPS)
        address, low = int(self.addresses[index]), f"{pins.low}_I"
        strobe = pins.write if self.write else pins.read
        match step:
            case 0:
                high, middle = address >> 16 & 0xFF, address >> 8 & 0xFF
                return ((pins.high, high), (low, middle), (pins.latch, 1))
            case 1:
                return ((pins.latch, 0),)
            case 2:
                byte = ((low, int(self.data[index])),) if self.write else ()
                return ((pins.high, address & 0xFF), *byte, (pins.selects[self.select], 0))
            case 3:
                return ((strobe, 0),)
            case 4:
                return ((strobe, 1),)
        return ((pins.selects[self.select], 1),)
