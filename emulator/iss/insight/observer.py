"""Observes a running machine: cycles and executions by address, calls, functions over time.

Observation slows the machine down but does not change its behaviour or timing.
"""

import ctypes
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.iss.binding import ChangeRecord, EdgeRecord, RangeRecord, simulator
from cubestack.emulator.iss.insight.fault_report import exception_name
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import FLASH_BASE, RAM_BASE, Machine

EXCEPTION_SITE = 0xFFFF_F000
MOST_EDGES = 1 << 14
MOST_CHANGES = 1 << 14
"""As in insight.cpp."""

FUNCTION, EXCEPTION, HANDLER = "function", "exception", "handler"
"""Variables of a history."""


@dataclass(frozen=True, order=True)
class Edge:
    """Calls from one place to one function."""

    site: int  #: address of the call, or number of the exception
    callee: int  #: address of the function
    count: int  #: number of calls
    cycles: int  #: of the function and everything it called
    exception: bool  #: whether the processor called it


class Change(NamedTuple):
    """From ``time_ps`` on the program is in ``function``, with ``exception`` active."""

    time_ps: int
    function: str
    exception: int


class Figures(NamedTuple):
    """Further measurements."""

    main_sp: int | None  #: lowest main stack pointer while in use; None before the first use
    process_sp: int | None  #: likewise of the process stack
    idle_cycles: int  #: cycles asleep
    edges_lost: int  #: calls not counted because the table was full


@dataclass
class Code:
    """Counters of a memory that can hold code, one element per half-word."""

    base: int
    cycles: NDArray[np.uint64]
    counts: NDArray[np.uint64]

    def cycles_of(self, address: int, end: int) -> int:
        """Sum over ``address``..``end`` - 1."""
        first, last = (address - self.base) // 2, (end - self.base + 1) // 2
        return int(self.cycles[max(first, 0) : max(last, 0)].sum())


class Observer:
    """Observes one machine until it is closed.

    Attributes:
        machine: the observed machine.
        symbols: of its program.
        ram_at_start: its RAM at the start of the observation.
        codes: counters of flash and RAM.
    """

    def __init__(self, machine: Machine, symbols: Symbols) -> None:
        self._library = simulator()
        self.machine, self.symbols = machine, symbols
        self.ram_at_start = machine.ram.copy()
        self.codes = []
        self._names = [""]
        self._kept: list[Any] = []
        ranges = (RangeRecord * 2)()
        for record, base, memory in zip(
            ranges, (FLASH_BASE, RAM_BASE), (machine.flash, machine.ram), strict=True
        ):
            record.base, record.size, record.host = base, memory.size, memory.ctypes.data
            halves = memory.size // 2
            code = Code(base, np.zeros(halves, np.uint64), np.zeros(halves, np.uint64))
            self.codes.append(code)
            record.cycles, record.counts = code.cycles.ctypes.data, code.counts.ctypes.data
            functions = self._functions(base, halves)
            self._kept.append(functions)
            record.functions = functions.ctypes.data
        self._found: list[Edge] = []
        self._last = Figures(None, None, 0, 0)
        self._changes = (ChangeRecord * MOST_CHANGES)()
        self._handle: int | None = self._library.insight_new(machine.handle, ranges, 2)

    def trace(self, on: bool = True) -> None:
        """Record changes from now on; the caller must collect them with ``changes``."""
        self._library.insight_trace(self._handle, on)

    def add(self, other: "Observer") -> None:
        """Add the counts of another observer of the same program; both must be closed."""
        for mine, its in zip(self.codes, other.codes, strict=True):
            mine.cycles += its.cycles
            mine.counts += its.counts
        self._found += other._found

    @property
    def closed(self) -> bool:
        return self._handle is None

    def close(self) -> None:
        """End the observation; the counts stay."""
        if self._handle is not None:
            self._found, self._last = self.edges(), self.figures()
            try:
                machine: int | None = self.machine.handle
            except RuntimeError:  # closed
                machine = None
            self._library.insight_delete(machine, self._handle)
            self._handle = None

    def count_of(self, address: int) -> int:
        """Number of executions of the instruction at ``address``."""
        for code in self.codes:
            index = (address - code.base) // 2
            if 0 <= index < code.counts.size:
                return int(code.counts[index])
        return 0

    def edges(self) -> list[Edge]:
        """Calls so far, including those that have not returned."""
        if self._handle is None:
            return self._found
        self._library.insight_finish(self._handle)
        records = (EdgeRecord * MOST_EDGES)()
        found = self._library.insight_edges(self._handle, records)
        return [
            Edge(
                one.site - EXCEPTION_SITE if one.site >= EXCEPTION_SITE else one.site,
                one.callee,
                one.count,
                one.cycles,
                one.site >= EXCEPTION_SITE,
            )
            for one in records[:found]
        ]

    def changes(self) -> Iterator[Change]:
        """Remove and yield the changes since the last call, in the order of time."""
        if self._handle is None:
            return
        count = self._library.insight_changes(self._handle, self._changes)
        for one in self._changes[:count]:
            name = self._names[one.function] if one.function else f"{one.pc:#010x}"
            yield Change(one.time, name, one.exception)

    def figures(self) -> Figures:
        if self._handle is None:
            return self._last
        values = (ctypes.c_int64 * 4)()
        self._library.insight_figures(self._handle, values)
        main, process = (None if sp == 0xFFFF_FFFF else sp for sp in values[:2])
        return Figures(main, process, values[2], values[3])

    def _functions(self, base: int, halves: int) -> NDArray[np.uint16]:
        """Number of the function of each half-word; 0: none."""
        numbers = np.zeros(halves, np.uint16)
        for function in self.symbols.functions:
            first, last = (function.address - base) // 2, (function.end - base + 1) // 2
            if 0 <= first < halves and len(self._names) < 0xFFFF:
                numbers[first:last] = len(self._names)
                self._names.append(function.name)
        return numbers


class History:
    """Functions and exceptions over time: an observer's changes as variables of a trace."""

    #: bits of each variable by name; None for text
    variables: Mapping[str, int | None] = {FUNCTION: None, EXCEPTION: 8, HANDLER: None}

    def __init__(self, observer: Observer, interrupts: Mapping[int, str]) -> None:
        """Start; ``interrupts``: names of the part's interrupts by number."""
        self._observer = observer
        self._interrupts = interrupts
        self._exception = 0
        observer.trace()

    def take(self) -> Iterator[tuple[int, str, int | str]]:
        """Changes since the last call by time: time in ps, variable, value."""
        for change in self._observer.changes():
            yield change.time_ps, FUNCTION, change.function
            if change.exception != self._exception:
                self._exception = change.exception
                yield change.time_ps, EXCEPTION, change.exception
                yield change.time_ps, HANDLER, exception_name(change.exception, self._interrupts)
