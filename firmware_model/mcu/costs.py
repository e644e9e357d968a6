"""Cycle costs of a processor's operations, and the meter that adds them up.

An algorithm charges the operations that its program would have executed, counted as they really
happened; a table turns the counts into cycles. The table of the EFM32GG (Cortex-M3, no floating
point unit, 48 MHz on CubeStar) stands here. Its transfer loop is the only entry that was fitted to
a published duration (CubeStar thesis, Table 6.2), so every other duration is a prediction.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal, get_args

Provenance = Literal["measured", "published", "fitted", "assumed"]


class CostError(ValueError):
    """A cost, a table or a charge that makes no sense; the message names the offender."""


@dataclass(frozen=True)
class Cost:
    """What one operation costs, in processor cycles, and why we think so."""

    cycles: int
    provenance: Provenance
    source: str

    def __post_init__(self) -> None:
        """Refuse costs that are not positive, not tagged or not explained."""
        if self.cycles < 1:
            raise CostError(f"a cost must be at least 1 cycle, not {self.cycles}")
        if self.provenance not in get_args(Provenance):
            known = ", ".join(get_args(Provenance))
            raise CostError(f"provenance must be one of {known}, not {self.provenance!r}")
        if not self.source:
            raise CostError(f"a cost of {self.cycles} cycles needs a source")


@dataclass(frozen=True)
class CostTable:
    """The operations of one processor at one clock.

    Attributes:
        name: the part, for messages and reports.
        clock_hz: cycles in a second.
        operations: cost of each operation by name.
    """

    name: str
    clock_hz: int
    operations: Mapping[str, Cost]

    def seconds(self, cycles: int) -> float:
        """Duration of so many cycles, in seconds."""
        return cycles / self.clock_hz


class Meter:
    """Counts the operations of a program and their cycles.

    Attributes:
        table: where the costs come from.
        total: cycles since the meter was made.
        counts: how often each operation was charged.
        phases: cycles charged inside each `phase`, added up over its visits.
    """

    def __init__(self, table: CostTable) -> None:
        """Start at zero with the costs of `table`."""
        self.table = table
        self.total = 0
        self.counts: Counter[str] = Counter()
        self.phases: dict[str, int] = {}
        self._taken = 0
        self._phase: str | None = None

    def charge(self, **operations: int) -> None:
        """Charge each named operation so many times.

        Raises:
            CostError: for an operation that the table does not have, or a negative count.
        """
        cycles = 0
        for name, count in operations.items():
            cost = self.table.operations.get(name)
            if cost is None:
                known = ", ".join(sorted(self.table.operations))
                raise CostError(
                    f"operation {name!r} is not in the table of {self.table.name} (it has {known})"
                )
            if count < 0:
                raise CostError(f"operation {name!r} cannot happen {count} times")
            self.counts[name] += count
            cycles += cost.cycles * count
        self.total += cycles
        if self._phase is not None:
            self.phases[self._phase] = self.phases.get(self._phase, 0) + cycles

    def book(self, **operations: int) -> None:
        """Count operations as `charge` does whose time has passed already: not to be taken."""
        before = self.total
        self.charge(**operations)
        self._taken += self.total - before

    def take(self) -> int:
        """Cycles charged since the last call (the first call: since the start)."""
        cycles = self.total - self._taken
        self._taken = self.total
        return cycles

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Book what is charged inside the block under `name`; an inner phase takes its own part."""
        outer, self._phase = self._phase, name
        self.phases.setdefault(name, 0)
        try:
            yield
        finally:
            self._phase = outer


def cortex_m3(
    *, clock_hz: int = 48_000_000, flash_waits: int = 2, ebi_waits: int = 6, gpio_waits: int = 0
) -> CostTable:
    """Costs of the EFM32GG's Cortex-M3 with software floating point.

    Args:
        clock_hz: core clock in Hz.
        flash_waits: wait states of a data read from flash. The vendor's clock driver sets none up
            to 16 MHz, one up to 32 MHz and two above. Instruction fetches are taken as hidden by
            the prefetcher and the cache.
        ebi_waits: cycles of one transaction on the External Bus Interface beyond the load or store
            itself (address latch, set-up, strobe); assumed, the thesis prints no timing registers.
        gpio_waits: extra cycles of one access to a GPIO register.
    """
    survey = "soft-float and integer routines on a Cortex-M3, flash at zero wait states"
    core = "Cortex-M3 Technical Reference Manual, instruction timing: load or store, 2 cycles"

    def measured(cycles: int) -> Cost:
        return Cost(cycles, "measured", survey)

    ebi = Cost(2 + ebi_waits, "assumed", f"load or store of 2 cycles + {ebi_waits} on the bus")
    interrupt = Cost(80, "assumed", "entry and exit of 12 cycles each, a byte through a queue")
    return CostTable(
        name="EFM32GG Cortex-M3",
        clock_hz=clock_hz,
        operations={
            "f32_add": measured(61),
            "f32_mul": measured(46),
            "f32_div": measured(148),
            "f32_sqrt": measured(369),
            "f32_atan2": measured(1881),
            "f32_acos": measured(1451),
            "f32_sin": Cost(1451, "assumed", "sine or cosine: as long as the arc cosine"),
            "f32_compare": Cost(25, "assumed", "library call that compares sign and magnitude"),
            "f32_convert": Cost(30, "assumed", "integer to float: library call, shift and pack"),
            "i32_add": measured(4),
            "i32_mul": measured(4),
            "i32_div": measured(11),
            "table_byte": measured(9),
            "loop": measured(5),
            "call": Cost(16, "assumed", "branch and link, four registers saved and restored"),
            "ram_read": Cost(2, "published", core),
            "ram_write": Cost(2, "published", core),
            "flash_read": Cost(2 + flash_waits, "published", f"{core}, + {flash_waits} waits"),
            "ebi_read": ebi,
            "ebi_write": ebi,
            "port_read": measured(3 + gpio_waits),
            "port_write": measured(2 + gpio_waits),
            "uart_interrupt": interrupt,
            "i2c_interrupt": interrupt,
            "host_message": Cost(600, "assumed", "look-up, checks and copies of one short message"),
            "transfer_byte": Cost(
                37,
                "fitted",
                "whole turn of the FPGA-to-SRAM copy loop: CubeStar thesis, Table 6.2, "
                "404 ms for 524 288 bytes at 48 MHz",
            ),
        },
    )


CORTEX_M3 = cortex_m3()
"""The processor of CubeStar as the thesis runs it (section 3.2): 48 MHz."""
