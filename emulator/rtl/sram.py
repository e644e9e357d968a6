"""Reference model of the asynchronous SRAM at the FPGA, with checks of its timing.

The part is Alliance Semiconductor's of the 12 ns class: AS7C34096A-12 gives 12 ns access and 6 ns
output enable. The CubeStar thesis (section 5.2.2) names only the maker and the size, 1024 kB.
"""

import logging
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

_log = logging.getLogger(__name__)

ViolationKind = Literal[
    "short-write-pulse",
    "address-changed-during-write",
    "data-setup",
    "read-access",
    "bus-contention",
    "turnaround",
    "wire-contention",
]

#: Text of each violation with its measured times, in the order of the C++ model's enum.
#: The last one concerns two FPGAs, not a memory; the engine detects it.
RULES: dict[ViolationKind, str] = {
    "short-write-pulse": "write pulse of {} ps, at least {} ps needed",
    "address-changed-during-write": "address moved {} ps into the write pulse",
    "data-setup": "data stable for {} ps at the end of the write, at least {} ps needed",
    "read-access": "data used {} ps after its cause, valid after {} ps",
    "bus-contention": "memory and FPGA both drive the data bus",
    "turnaround": "FPGA drives the bus {} ps after the memory let go, {} ps needed",
    "wire-contention": "two FPGAs drive the same wires, CONTENTION is {}",
}

#: Place of a wire contention.
BETWEEN_FPGAS = "wires"

MAX_VIOLATIONS = 64  # of each kind are kept; all are counted
LONG_AGO = -(10**12)


@dataclass(frozen=True)
class SramTiming:
    """Limits of the part in ps. Address set-up and hold times are 0, as for this class of parts."""

    access_ps: int = 12_000  # address or chip enable to valid data, at most (AS7C34096A-12)
    output_enable_ps: int = 6_000  # output enable to valid data, at most (AS7C34096A-12)
    # output disable to a free bus, at most (assumed, as output enable)
    output_disable_ps: int = 6_000
    # width of the write pulse, at least (assumed, usual for a 12 ns part)
    write_pulse_ps: int = 8_000
    # data valid before the end of the write, at least (assumed, likewise)
    data_setup_ps: int = 6_000


class Violation(NamedTuple):
    """One broken rule of the memory's data sheet, or two drivers on one wire.

    The model continues as a good part at room temperature might; a real part may fail. ``found``
    and ``needed`` are in ps; ``where`` is the memory's name, or ``BETWEEN_FPGAS``.
    """

    kind: ViolationKind
    time_ps: int
    address: int
    found: int = 0
    needed: int = 0
    where: str = "SRAM"

    @property
    def detail(self) -> str:
        return RULES[self.kind].format(self.found, self.needed)


@dataclass
class ViolationLog:
    """The first ``MAX_VIOLATIONS`` of each kind, ordered by time, and the number of all.

    The first of each kind also goes to the Python log as a warning.
    """

    kept: list[Violation] = field(default_factory=list)
    counts: Counter[ViolationKind] = field(default_factory=Counter)

    def add(self, violation: Violation) -> None:
        if not self.counts[violation.kind]:
            kind, time_ps, address, *_, where = violation
            text = "%s %s at %d ps, address 0x%05X: %s"
            _log.warning(text, where, kind, time_ps, address, violation.detail)
        self.counts[violation.kind] += 1
        if self.counts[violation.kind] <= MAX_VIOLATIONS:
            self.kept.append(violation)


@contextmanager
def no_log() -> Iterator[None]:
    """Keep violations out of the Python log, in runs that repeat one that was reported."""
    before, _log.disabled = _log.disabled, True
    try:
        yield
    finally:
        _log.disabled = before


class SramPins(NamedTuple):
    """Settled levels of the memory's pins.

    ``data`` is the byte that the FPGA drives, None while it does not drive the bus.
    """

    address: int = 0
    ce_n: int = 1
    oe_n: int = 1
    we_n: int = 1
    data: int | None = None

    @property
    def writes(self) -> bool:
        return not self.ce_n and not self.we_n

    @property
    def reads(self) -> bool:
        return not self.ce_n and not self.oe_n and bool(self.we_n)


@dataclass
class Sram:
    """The memory; ``drive`` must be called at every change of its pins.

    A write takes effect at the end of its pulse, with the address and data from just before that
    instant: hold times are 0, so address and data may change together with the end of the pulse.
    """

    memory: NDArray[np.uint8]  # the stored bytes, shape (size,); a live view
    timing: SramTiming = field(default_factory=SramTiming)
    # log of violations; several memories may share it
    violations: ViolationLog = field(default_factory=ViolationLog)
    name: str = "SRAM"  # the memory's name in violations

    def __post_init__(self) -> None:
        self.power(True)

    def power(self, on: bool) -> None:
        """Switch the supply; the pins are inactive until the next ``drive``.

        Without supply the memory ignores writes, returns 0 and reports no violations.
        """
        self._powered = on
        self._pins = SramPins()
        self._write_since = self._data_since = self._address_since = LONG_AGO
        self._selected_since = self._reads_since = self._released_at = LONG_AGO

    @property
    def powered(self) -> bool:
        return self._powered

    @property
    def reads(self) -> bool:
        """Whether it drives the data bus, with a byte or without supply."""
        return self._pins.reads

    @property
    def bus(self) -> int:
        """Level of the data bus: the memory's byte, else the FPGA's, else 0 on a floating bus."""
        if self._pins.reads:
            return int(self.memory[self._pins.address])
        return self._pins.data or 0

    def drive(self, time_ps: int, pins: SramPins) -> None:
        """Set the settled pin levels from ``time_ps`` on; times must not decrease."""
        if not self._powered:
            return
        old, self._pins = self._pins, pins
        moved = pins.address != old.address
        if old.writes and (moved or not pins.writes):
            if pins.writes:
                into = time_ps - self._write_since
                self._report("address-changed-during-write", time_ps, old.address, into)
            self._end_write(time_ps, old)
        if pins.writes and (moved or not old.writes):
            self._write_since = time_ps
        self._check_bus(time_ps, old, pins)
        if moved:
            self._address_since = time_ps
        if old.ce_n and not pins.ce_n:
            self._selected_since = time_ps
        if pins.data != old.data:
            self._data_since = time_ps

    def sample(self, time_ps: int) -> int:
        """The level of the bus that the FPGA samples at ``time_ps``; checks that it is valid."""
        if self._pins.reads:
            for since, needed in (
                (self._address_since, self.timing.access_ps),
                (self._selected_since, self.timing.access_ps),
                (self._reads_since, self.timing.output_enable_ps),
            ):
                if (found := time_ps - since) < needed:
                    self._report("read-access", time_ps, self._pins.address, found, needed)
                    break
        return self.bus

    def _end_write(self, time_ps: int, old: SramPins) -> None:
        width, needed = time_ps - self._write_since, self.timing.write_pulse_ps
        if width < needed:
            self._report("short-write-pulse", time_ps, old.address, width, needed)
        setup = 0 if old.data is None else time_ps - self._data_since
        needed = self.timing.data_setup_ps
        if setup < needed:
            self._report("data-setup", time_ps, old.address, setup, needed)
        self.memory[old.address] = old.data or 0

    def _check_bus(self, time_ps: int, old: SramPins, pins: SramPins) -> None:
        if pins.reads and not old.reads:
            self._reads_since = time_ps
        if old.reads and not pins.reads:
            self._released_at = time_ps
        drives, drove = pins.data is not None, old.data is not None
        if drives and pins.reads and not (drove and old.reads):
            self._report("bus-contention", time_ps, pins.address)
        free, needed = time_ps - self._released_at, self.timing.output_disable_ps
        if drives and not drove and not pins.reads and free < needed:
            self._report("turnaround", time_ps, pins.address, free, needed)

    def _report(
        self, kind: ViolationKind, time_ps: int, address: int, found: int = 0, needed: int = 0
    ) -> None:
        self.violations.add(Violation(kind, time_ps, address, found, needed, self.name))
