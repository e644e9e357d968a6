"""Halts a machine, and virtual time with it, for a debugger.

A breakpoint ends the machine's run in the middle of an event of the kernel; the event after it is
at the same time, and the kernel makes no step before the debugger lets it. So everything stands,
and nothing has happened that would not have happened without: a trace is the same. The machine may
be ahead of the kernel then, by no more than to the next thing that happens.

While the kernel is paused, a scheduler of ports makes no steps; anybody else's call of
``Kernel.step`` waits in ``serve``.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from time import monotonic_ns
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.iss.gdb.description import REGISTERS
from cubestack.emulator.iss.gdb.target import (
    SIGBUS,
    SIGILL,
    SIGINT,
    SIGSEGV,
    MemoryRegion,
    WatchKind,
)
from cubestack.emulator.iss.gdb.target import Stop as Reason
from cubestack.emulator.iss.machine import NEVER, Machine, Stop, StopReason, Watch
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

WATCHES: Mapping[WatchKind, str] = {"write": "w", "read": "r", "access": "a"}

VECTOR_TABLE = 0xE000_ED08
CFSR = 0xE000_ED28
"""Addresses of VTOR and CFSR: ARMv7-M Architecture Reference Manual, B3.2.2."""

FAULTS = {3: SIGSEGV, 4: SIGSEGV, 5: SIGBUS, 6: SIGILL}
"""Signals of the faults by their exception numbers."""

LONGEST_RESTART_S = 1.0


class Window(Protocol):
    """Memory of something else that a debugger sees beside the machine's."""

    def read(self, offset: int, count: int) -> bytes:
        """Bytes, fewer where it ends."""

    def write(self, offset: int, data: bytes) -> bool:
        """Change bytes."""


@dataclass(frozen=True)
class ArrayWindow:
    """A window on an array of bytes."""

    memory: NDArray[np.uint8]

    def read(self, offset: int, count: int) -> bytes:
        """Bytes of it."""
        return self.memory[offset : offset + count].tobytes()

    def write(self, offset: int, data: bytes) -> bool:
        """Change bytes of it."""
        if offset + len(data) > self.memory.size:
            return False
        self.memory[offset : offset + len(data)] = np.frombuffer(data, np.uint8)
        return True


@dataclass(eq=False)
class Debugger:
    """A target for debuggers: a machine that a processor runs in virtual time.

    Attributes:
        kernel: virtual time.
        machine: what is debugged.
        reset: resets the processor.
        own_regions: the part's memory map.
        windows: further memories, by the lines of the memory map that they add.
        command: answers ``monitor`` commands that are not about the processor.
        serve: waits for the debugger a moment, while the kernel is paused.
        visit: looks at the debugger, if it is time again.
    """

    kernel: Kernel
    machine: Machine
    reset: Callable[[], None]
    own_regions: tuple[MemoryRegion, ...]
    windows: Mapping[MemoryRegion, Window] = field(default_factory=dict)
    command: Callable[[list[str]], str] = lambda words: ""
    serve: Callable[[], None] = lambda: None
    visit: Callable[[], None] = lambda: None

    def __post_init__(self) -> None:
        """Take a place before the kernel."""
        self.halted: Reason | None = None
        self.catching = False
        self._since_ns = 0
        self._range: tuple[int, int] | None = None
        self._to_wake = False  # a step has fallen asleep: stand when it goes on
        self._restarting = False
        self._caught: set[int] = set()
        self._watches: dict[tuple[int, int, WatchKind], Watch] = {}
        self._step = self.kernel.step
        vars(self.kernel)["step"] = self._gated_step
        self.machine.attach_debugger(True)

    def close(self) -> None:
        """Let everything run without a debugger."""
        self.clear_points()
        self.resume()
        self.machine.attach_debugger(False)
        if self._step.__func__ is Kernel.step:  # type: ignore[attr-defined]
            vars(self.kernel).pop("step", None)
        else:
            vars(self.kernel)["step"] = self._step

    def _gated_step(self) -> None:
        self.visit()
        while self.kernel.paused:
            self.serve()
        self._step()

    # --- the processor's side -------------------------------------------------------------------

    def run(self, until_ps: int) -> Stop:
        """``Machine.run`` as the debugger wants it; the kernel is paused where it stands then."""
        self._catch()
        if self._restarting:
            self._restarting = False
            self._stand(Reason())
            return Stop(StopReason.STEPPED, self.machine.now_ps)
        if self._to_wake:
            return self._await_waking(until_ps)
        if self._range is not None:
            return self._run_step(until_ps)
        stop = self.machine.run(until_ps)
        self._look(stop)
        return stop

    def _run_step(self, until_ps: int) -> Stop:
        assert self._range is not None
        low, high = self._range
        before = self.machine.instructions
        stop = self.machine.step(until_ps)
        while (
            stop.reason is StopReason.STEPPED
            and low <= self.machine.register("pc") < high
            and stop.now_ps < until_ps
        ):
            stop = self.machine.step(until_ps)
        self._look(stop)
        if self.halted is None and self.machine.instructions != before:
            if self.machine.asleep:
                self._to_wake = True
            elif not low <= self.machine.register("pc") < high:
                self._stand(Reason())
        return stop

    def _await_waking(self, until_ps: int) -> Stop:
        """Time passes up to what ends the sleep; stands before what comes then."""
        stop = self.machine.run(min(until_ps, self.machine.next_event_ps))
        if not self.machine.asleep:
            self._stand(Reason())
        return stop

    def _look(self, stop: Stop) -> None:
        """Stand where the end of a run is the debugger's."""
        match stop.reason:
            case StopReason.BREAKPOINT:
                self._at_breakpoint()
            case StopReason.WATCHPOINT:
                self._stand(Reason(watch=self._hit(self.machine.watch_hit.address)))
            case StopReason.HALTED:
                self._stand(Reason())
            case StopReason.LOCKED_UP:
                self._stand(Reason(SIGSEGV))

    def _at_breakpoint(self) -> None:
        number = self.machine.register("xpsr") & 0x1FF
        if self.machine.register("pc") in self._caught and number in FAULTS:
            self._stand(Reason(self._fault_signal(number)))
        else:
            self._stand(Reason(breakpoint=True))

    def _fault_signal(self, number: int) -> int:
        """That of the fault; of one that was escalated, that of what it was."""
        status = int.from_bytes(self.machine.peek(CFSR, 4), "little")
        for shift, kind in ((16, 6), (8, 5), (0, 4)):
            if number == 3 and status >> shift & (0xFFFF if shift == 16 else 0xFF):
                number = kind
                break
        return FAULTS[number]

    def _hit(self, address: int) -> tuple[WatchKind, int]:
        """The watchpoint that was hit, by an address of the access."""
        for start, count, kind in self._watches:
            if start - 3 <= address < start + count:  # an access has at most four bytes
                return kind, start
        return "access", address

    def _stand(self, reason: Reason) -> None:
        self.halted = reason
        if not self.kernel.paused:
            self.kernel.paused, self._since_ns = True, monotonic_ns()
        self._range = None
        self._to_wake = False

    def _catch(self) -> None:
        """Breakpoints at the fault handlers, where the vector table has them now."""
        points = self.machine.breakpoints
        wanted = set()
        if self.catching:
            table = int.from_bytes(self.machine.peek(VECTOR_TABLE, 4), "little")
            vectors = self.machine.peek(table + 4 * min(FAULTS), 4 * len(FAULTS))
            wanted = {word & ~1 for word in memoryview(vectors).cast("I")}
        for address in self._caught - wanted:
            points.discard(address)
        for address in wanted - set(points):
            points.add(address)
            self._caught.add(address)
        self._caught &= wanted

    # --- the debugger's side --------------------------------------------------------------------

    @property
    def registers(self) -> dict[int, str]:
        """See ``Target``."""
        return REGISTERS

    @property
    def regions(self) -> tuple[MemoryRegion, ...]:
        """See ``Target``."""
        return (*self.own_regions, *self.windows)

    def halt(self) -> None:
        """See ``Target``."""
        if self.halted is None:
            self._stand(Reason(SIGINT))

    def resume(self) -> None:
        """See ``Target``."""
        self.halted = None
        if self.kernel.paused:
            self.kernel.paused = False
            self.kernel.held_ns += monotonic_ns() - self._since_ns

    def step(self, low: int, high: int) -> None:
        """See ``Target``."""
        self._range = low, high
        if self.machine.asleep:
            self._to_wake = True
        self.resume()

    def register(self, name: str) -> int:
        """See ``Target``."""
        return self.machine.register(name)

    def set_register(self, name: str, value: int) -> None:
        """See ``Target``."""
        self.machine.set_register(name, value)

    def read(self, address: int, count: int) -> bytes:
        """See ``Target``."""
        for region, window in self.windows.items():
            if region.start <= address < region.start + region.length:
                return window.read(address - region.start, count)
        return self.machine.peek(address, count)

    def write(self, address: int, data: bytes) -> bool:
        """See ``Target``."""
        for region, window in self.windows.items():
            if region.start <= address < region.start + region.length:
                return window.write(address - region.start, data)
        return self.machine.poke(address, data) == len(data)

    def set_breakpoint(self, address: int, on: bool) -> None:
        """See ``Target``."""
        self._caught.discard(address)
        (self.machine.breakpoints.add if on else self.machine.breakpoints.discard)(address)

    def set_watchpoint(self, address: int, count: int, kind: WatchKind, on: bool) -> None:
        """See ``Target``."""
        watch = Watch(address, count, WATCHES[kind])
        self.machine.watch(watch, on)
        if on:
            self._watches[address, count, kind] = watch
        else:
            self._watches.pop((address, count, kind), None)

    def clear_points(self) -> None:
        """See ``Target``."""
        for address in list(self.machine.breakpoints):
            self.machine.breakpoints.discard(address)
        self._caught.clear()
        for watch in self._watches.values():
            self.machine.watch(watch, False)
        self._watches.clear()
        self.catching = False

    def restart(self) -> None:
        """See ``Target``; virtual time passes up to the first instruction."""
        self._range, self._to_wake = None, False
        self._restarting = True
        self.resume()
        self.reset()
        end_ps = self.kernel.now + round(LONGEST_RESTART_S * PS_PER_S)
        while self.halted is None and (self.kernel.horizon() or NEVER) <= end_ps:
            self._step()
        self._restarting = False
        self._stand(self.halted or Reason())

    def monitor(self, command: str) -> str:
        """See ``Target``."""
        match command.split():
            case [] | ["help"]:
                own = "reset [halt]      reset the processor\ncatch on|off      stop at faults"
                return f"{own}\n{self.command(['help'])}"
            case ["reset"]:
                self.reset()
                return "the processor is reset when it goes on"
            case ["reset", "halt" | "init"]:
                self.restart()
                return ""
            case ["catch", "on" | "off" as state]:
                self.catching = state == "on"
                return ""
            case words:
                return self.command(words)
