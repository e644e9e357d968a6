"""Halts a machine, and virtual time with it, for a debugger.

A breakpoint ends the machine's run in the middle of an event of the kernel; the event after it is
at the same time, and the kernel makes no step before the debugger lets it. So everything stands,
and nothing has happened that would not have happened without: a trace is the same. The machine may
be ahead of the kernel then, by no more than to the next thing that happens.

While the kernel is held, a scheduler of ports makes no steps; anybody else's call of
``Kernel.step`` waits in ``serve``.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
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
from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import Stop, StopReason, Watch, WatchHit
from cubestack.emulator.sim.virtual_time import Kernel

WATCHES: Mapping[WatchKind, str] = {"write": "w", "read": "r", "access": "a"}

CFSR = 0xE000_ED28
"""Address of the fault status: ARMv7-M Architecture Reference Manual, B3.2.2."""

FAULT_SIGNALS = {0xFFFF_0000: SIGILL, 0xFF00: SIGBUS, 0x00FF: SIGSEGV}
"""By the bits of CFSR: usage faults, bus faults, memory management."""

ALL_FAULTS = 0x7F0
"""Bits VC_* of DEMCR but that for a reset: C1.6.5."""

BKPT_BYTES = 2

HOLDER = "debugger"
"""Who holds the kernel."""

OWN_COMMANDS = """reset [halt]      reset the processor, and stand at its first instruction
catch on|off      stop at faults, before their handlers"""


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
        self._attached = False
        self._range: tuple[int, int] | None = None
        self._to_wake = False  # a step has fallen asleep: stand when it goes on
        self._at_bkpt: int | None = None
        self._told_lock_up = False
        self._watches: dict[tuple[int, int, WatchKind], Watch] = {}
        self._step = self.kernel.step
        vars(self.kernel)["step"] = self._gated_step

    def close(self) -> None:
        """Let everything run without a debugger."""
        self.detach()
        vars(self.kernel)["step"] = self._step

    def _gated_step(self) -> None:
        self.visit()
        while self.kernel.paused:
            self.serve()
        self._step()

    # --- the processor's side -------------------------------------------------------------------

    def run(self, until_ps: int) -> Stop:
        """``Machine.run`` as the debugger wants it; the kernel is paused where it stands then."""
        machine = self.machine
        if self.kernel.paused:  # somebody gives it an input: it stands where it is
            return Stop(StopReason.TIME, machine.now_ps)
        if not self._attached:
            return machine.run(until_ps)
        if self._range is None or self._to_wake:
            stop = machine.run(until_ps)
        else:
            stop = machine.step(until_ps, self._range)
        self._look(stop)
        if self._to_wake and not machine.asleep:
            self._stand(Reason())
        return stop

    def _look(self, stop: Stop) -> None:
        """Stand where the end of a run is the debugger's."""
        if stop.reason is not StopReason.LOCKED_UP:
            self._told_lock_up = False
        match stop.reason:
            case StopReason.STEPPED if self.machine.asleep:
                self._to_wake = True
            case StopReason.STEPPED:
                self._stand(Reason())
            case StopReason.BREAKPOINT:
                self._stand(Reason(breakpoint=True))
            case StopReason.WATCHPOINT:
                self._stand(Reason(watch=self._hit(self.machine.watch_hit)))
            case StopReason.HALTED:
                self._at_bkpt = self.machine.register("pc")
                self._stand(Reason())
            case StopReason.FAULT:
                self._stand(Reason(self._fault_signal()))
            case StopReason.LOCKED_UP if not self._told_lock_up:
                self._told_lock_up = True
                self._stand(Reason(SIGSEGV))

    def _fault_signal(self) -> int:
        """That of the fault; of one that was escalated, that of what it was."""
        status = int.from_bytes(self.machine.peek(CFSR, 4), "little")
        for mask, signal in FAULT_SIGNALS.items():
            if status & mask:
                return signal
        return SIGSEGV

    def _hit(self, hit: WatchHit) -> tuple[WatchKind, int]:
        """The watchpoint that was hit."""
        for start, count, kind in self._watches:
            apt = kind == "access" or hit.write == (kind == "write")
            if apt and start < hit.address + hit.size and hit.address < start + count:
                return kind, start
        return "access", hit.address

    def _stand(self, reason: Reason) -> None:
        self.halted = reason
        self.kernel.hold(HOLDER)
        self._range = None
        self._to_wake = False

    # --- the debugger's side --------------------------------------------------------------------

    @property
    def registers(self) -> dict[int, str]:
        """See ``Target``."""
        return REGISTERS

    @property
    def regions(self) -> tuple[MemoryRegion, ...]:
        """See ``Target``."""
        return (*self.own_regions, *self.windows)

    def attach(self) -> None:
        """See ``Target``."""
        self._attached = True
        self.machine.attach_debugger(True)
        self.halt()

    def detach(self) -> None:
        """See ``Target``."""
        for address in list(self.machine.breakpoints):
            self.machine.breakpoints.discard(address)
        for watch in self._watches.values():
            self.machine.watch(watch, False)
        self._watches.clear()
        self.machine.attach_debugger(False)
        self._attached = False
        self.resume()

    def halt(self) -> None:
        """See ``Target``."""
        if self.halted is None:
            self._stand(Reason(SIGINT))

    def resume(self) -> None:
        """See ``Target``."""
        if self._at_bkpt is not None and self._at_bkpt == self.machine.register("pc"):
            self.machine.set_register("pc", self._at_bkpt + BKPT_BYTES)
        self._at_bkpt = None
        self.halted = None
        self.kernel.release(HOLDER)

    def step(self, low: int, high: int) -> None:
        """See ``Target``."""
        self.resume()
        self._range, self._to_wake = (low, high), self.machine.asleep

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
        (self.machine.breakpoints.add if on else self.machine.breakpoints.discard)(address)

    def set_watchpoint(self, address: int, count: int, kind: WatchKind, on: bool) -> None:
        """See ``Target``."""
        watch = Watch(address, count, WATCHES[kind])
        self.machine.watch(watch, on)
        if on:
            self._watches[address, count, kind] = watch
        else:
            self._watches.pop((address, count, kind), None)

    def restart(self) -> None:
        """See ``Target``."""
        self._stand(Reason())
        self.reset()

    def monitor(self, command: str) -> str:
        """See ``Target``."""
        match command.split():
            case [] | ["help"]:
                return f"{OWN_COMMANDS}\n{self.command(['help'])}"
            case ["reset"] | ["reset", "halt" | "init"]:
                self.restart()
                return ""
            case ["catch", "on" | "off" as state]:
                self.machine.attach_debugger(True, ALL_FAULTS if state == "on" else 0)
                return ""
            case words:
                return self.command(words)
