"""Changes of a microcontroller's flash, and the states in which a power cut leaves it.

Programming moves charge into the cells of a word, erasing removes it from all cells of a page, each
over tens of microseconds to milliseconds. No two cells are equally fast. A cut in between leaves
some of them changed; here each cell's time is drawn evenly from the duration of the operation.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

PAGE_BYTES = 4096
INFORMATION_BASE, PAGE_STEP = 0x0FE0_0000, 0x4000
"""Address of the first page of information, and the distance between them."""


class FlashChange(NamedTuple):
    """A word that was programmed, or pages that were erased."""

    time_ps: int  #: start
    duration_ps: int  #: time for which the flash is busy
    address: int  #: first byte
    size: int  #: in bytes
    before: int  #: contents of a word
    after: int  #: contents of a word
    pc: int  #: of the instruction that was running at the start
    erased: int  #: whether pages were erased

    @classmethod
    def of(cls, record: Any) -> Self:
        """From ``FlashChangeRecord``."""
        return cls._make(getattr(record, name) for name, _ in record._fields_)


@dataclass(frozen=True)
class FlashOperation:
    """Changes that the flash makes at the same time: one, or two words with WDOUBLE."""

    changes: tuple[FlashChange, ...]

    @property
    def first(self) -> FlashChange:
        return self.changes[0]

    @property
    def time_ps(self) -> int:
        return self.first.time_ps

    @property
    def end_ps(self) -> int:
        return self.time_ps + self.first.duration_ps

    @property
    def erases(self) -> bool:
        return bool(self.first.erased)


def operations(changes: Iterable[FlashChange]) -> list[FlashOperation]:
    grouped = groupby(changes, lambda one: one.time_ps)
    return [FlashOperation(tuple(group)) for _, group in grouped]


class FlashMachine(Protocol):
    """What has the flash: a machine."""

    flash: NDArray[np.uint8]
    information: NDArray[np.uint8]

    def invalidate(self, address: int, count: int) -> None: ...


@dataclass(frozen=True)
class FlashContents:
    """Flash (bytes from address 0) and pages of information of a machine."""

    flash: NDArray[np.uint8]
    information: NDArray[np.uint8]

    @classmethod
    def of(cls, machine: FlashMachine) -> "FlashContents":
        """A copy of what the machine has."""
        return cls(machine.flash.copy(), machine.information.copy())

    def copy(self) -> "FlashContents":
        return FlashContents(self.flash.copy(), self.information.copy())

    def load(self, machine: FlashMachine) -> None:
        """Put these contents into a machine."""
        machine.information[:] = self.information
        ours, theirs = (one.reshape(-1, PAGE_BYTES) for one in (self.flash, machine.flash))
        for page in np.flatnonzero((ours != theirs).any(axis=1)).tolist():
            theirs[page] = ours[page]
            machine.invalidate(page * PAGE_BYTES, PAGE_BYTES)

    def apply(self, operation: FlashOperation) -> None:
        """Change them as the completed operation does."""
        for change in operation.changes:
            cells = self._bytes(change)
            if change.erased:
                cells[:] = 0xFF
            else:
                cells[:] = np.frombuffer(change.after.to_bytes(4, "little"), np.uint8)

    def tear(self, operation: FlashOperation, share: float, rng: np.random.Generator) -> None:
        """Change them as an operation does that is cut after ``share`` (0 to 1) of its duration.

        Each cell changes with that probability, so an erased page is a mixture of the old contents
        and ones, and a programmed word has some of its zeros.
        """
        for change in operation.changes:
            cells = self._bytes(change)
            fast = np.packbits(rng.random(8 * cells.size) < share)
            if change.erased:
                cells |= fast
            else:
                after = np.frombuffer(change.after.to_bytes(4, "little"), np.uint8)
                cells &= ~(fast & ~after)

    def same_as(self, machine: FlashMachine) -> bool:
        """Whether the machine has these contents."""
        return np.array_equal(self.flash, machine.flash) and np.array_equal(
            self.information, machine.information
        )

    def _bytes(self, change: FlashChange) -> NDArray[np.uint8]:
        if change.address < INFORMATION_BASE:
            return self.flash[change.address : change.address + change.size]
        page, offset = divmod(change.address - INFORMATION_BASE, PAGE_STEP)
        start = page * PAGE_BYTES + offset
        return self.information[start : start + change.size]
