"""Halts a machine, and virtual time with it, for a debugger.

A breakpoint ends the machine's run in the middle of a kernel event. The next event is at the same
time, and the kernel waits there until the debugger resumes. Halting therefore changes nothing: a
trace is the same with and without a debugger. A halted machine may be ahead of the kernel, at most
up to the next event.

While the kernel is held, a scheduler of ports makes no steps; any other caller of ``Kernel.step``
waits in ``serve``.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.iss.gdb.target import (
    REGISTERS,
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
from cubestack.emulator.sim import debugger_commands
from cubestack.emulator.sim.virtual_time import Kernel

WATCHES: Mapping[WatchKind, str] = {"write": "w", "read": "r", "access": "a"}

CFSR = 0xE000_ED28
"""Address of the fault status: ARMv7-M Architecture Reference Manual, B3.2.2."""

FAULT_SIGNALS = {0xFFFF_0000: SIGILL, 0xFF00: SIGBUS, 0x00FF: SIGSEGV}
"""By the bits of CFSR: usage faults, bus faults, memory management."""

BKPT_BYTES = 2

HOLDER = "debugger"


class Window(Protocol):
    """Memory outside the machine that a debugger can access."""

    def read(self, offset: int, count: int) -> bytes:
        """``count`` bytes; fewer at the end of the memory."""

    def write(self, offset: int, data: bytes) -> bool:
        """Returns False, and writes nothing, beyond the end of the memory."""


@dataclass(frozen=True)
class ArrayWindow:
    """A window onto an array of bytes."""

    memory: NDArray[np.uint8]

    def read(self, offset: int, count: int) -> bytes:
        return self.memory[offset : offset + count].tobytes()

    def write(self, offset: int, data: bytes) -> bool:
        if offset + len(data) > self.memory.size:
            return False
        self.memory[offset : offset + len(data)] = np.frombuffer(data, np.uint8)
        return True


@dataclass(eq=False)
class Debugger:
    """A target for debuggers: a machine that a processor runs in virtual time.

    The methods from ``registers`` on implement ``iss.gdb.target.Target``.
    """

    kernel: Kernel
    machine: Machine
    reset: Callable[[], None]
    own_regions: tuple[MemoryRegion, ...]  #: the part's memory map
    #: further memories, by the regions that they add to the memory map
    windows: Mapping[MemoryRegion, Window] = field(default_factory=dict)
    #: answers ``monitor`` commands that do not concern the processor
    command: Callable[[list[str]], str] = lambda words: ""
    #: called repeatedly while the kernel is paused; blocks briefly for debugger input
    serve: Callable[[], None] = lambda: None
    #: called before each kernel step; polls the debugger when that is due
    poll: Callable[[], None] = lambda: None

    def __post_init__(self) -> None:
        self.halted: Reason | None = None
        self._attached = False
        self._range: tuple[int, int] | None = None
        self._halt_on_wake = False  # a step ended in sleep: halt when the core wakes
        self._at_bkpt: int | None = None
        self._reported_lock_up = False
        self._watches: dict[tuple[int, int, WatchKind], Watch] = {}
        self._step = self.kernel.step
        vars(self.kernel)["step"] = self._gated_step

    def close(self) -> None:
        """Detach, and restore the kernel's ``step``."""
        self.detach()
        vars(self.kernel)["step"] = self._step

    def _gated_step(self) -> None:
        self.poll()
        while self.kernel.paused:
            self.serve()
        self._step()

    # --- the processor's side -------------------------------------------------------------------

    def run(self, until_ps: int) -> Stop:
        """As ``Machine.run``; pauses the kernel where the debugger halts the machine."""
        machine = self.machine
        if self.kernel.paused:  # an input arrives while halted: stay halted
            return Stop(StopReason.TIME, machine.now_ps)
        if not self._attached:
            return machine.run(until_ps)
        if self._range is None or self._halt_on_wake:
            stop = machine.run(until_ps)
        else:
            stop = machine.step(until_ps, self._range)
        self._halt_on(stop)
        if self._halt_on_wake and not machine.asleep:
            self._halt(Reason())
        return stop

    def _halt_on(self, stop: Stop) -> None:
        if stop.reason is not StopReason.LOCKED_UP:
            self._reported_lock_up = False
        match stop.reason:
            case StopReason.STEPPED if self.machine.asleep:
                self._halt_on_wake = True
            case StopReason.STEPPED:
                self._halt(Reason())
            case StopReason.BREAKPOINT:
                self._halt(Reason(breakpoint=True))
            case StopReason.WATCHPOINT:
                self._halt(Reason(watch=self._find_watchpoint(self.machine.watch_hit)))
            case StopReason.HALTED:
                self._at_bkpt = self.machine.register("pc")
                self._halt(Reason())
            case StopReason.FAULT:
                self._halt(Reason(self._fault_signal()))
            case StopReason.LOCKED_UP if not self._reported_lock_up:
                self._reported_lock_up = True
                self._halt(Reason(SIGSEGV))

    def _fault_signal(self) -> int:
        """Signal of the fault; for an escalated fault, that of the original one."""
        status = int.from_bytes(self.machine.peek(CFSR, 4), "little")
        for mask, signal in FAULT_SIGNALS.items():
            if status & mask:
                return signal
        return SIGSEGV

    def _find_watchpoint(self, hit: WatchHit) -> tuple[WatchKind, int]:
        for start, count, kind in self._watches:
            matches = kind == "access" or hit.write == (kind == "write")
            if matches and start < hit.address + hit.size and hit.address < start + count:
                return kind, start
        return "access", hit.address

    def _halt(self, reason: Reason) -> None:
        self.halted = reason
        self.kernel.hold(HOLDER)
        self._range = None
        self._halt_on_wake = False

    # --- the debugger's side --------------------------------------------------------------------

    @property
    def registers(self) -> dict[int, str]:
        return REGISTERS

    @property
    def regions(self) -> tuple[MemoryRegion, ...]:
        return (*self.own_regions, *self.windows)

    def attach(self) -> None:
        self._attached = True
        self.machine.attach_debugger(True)
        self.halt()

    def detach(self) -> None:
        for address in list(self.machine.breakpoints):
            self.machine.breakpoints.discard(address)
        for watch in self._watches.values():
            self.machine.watch(watch, False)
        self._watches.clear()
        self.machine.attach_debugger(False)
        self._attached = False
        self.resume()

    def halt(self) -> None:
        if self.halted is None:
            self._halt(Reason(SIGINT))

    def program_ended(self) -> None:
        """Halt for the debugger, if there is one: the program runs no further until a reset."""
        if self._attached:
            self._halt(Reason())

    def resume(self) -> None:
        self._pass_bkpt()
        self.halted = None
        self.kernel.release(HOLDER)

    def _pass_bkpt(self) -> int | None:
        """Step over a BKPT at which the program halted; returns the next address."""
        at, self._at_bkpt = self._at_bkpt, None
        if at is None or at != self.machine.register("pc"):
            return None
        self.machine.set_register("pc", at + BKPT_BYTES)
        return at + BKPT_BYTES

    def step(self, low: int, high: int) -> None:
        after = self._pass_bkpt()
        if after is not None and not low <= after < high:
            self._halt(Reason())  # the BKPT was the one instruction
            return
        self.resume()
        self._range, self._halt_on_wake = (low, high), self.machine.asleep

    def register(self, name: str) -> int:
        return self.machine.register(name)

    def set_register(self, name: str, value: int) -> None:
        self.machine.set_register(name, value)

    def read(self, address: int, count: int) -> bytes:
        if (found := self._window(address)) is not None:
            return found[0].read(found[1], count)
        return self.machine.peek(address, count)

    def write(self, address: int, data: bytes) -> bool:
        if (found := self._window(address)) is not None:
            return found[0].write(found[1], data)
        return self.machine.poke(address, data) == len(data)

    def _window(self, address: int) -> tuple[Window, int] | None:
        for region, window in self.windows.items():
            if region.start <= address < region.start + region.length:
                return window, address - region.start
        return None

    def set_breakpoint(self, address: int, on: bool) -> None:
        (self.machine.breakpoints.add if on else self.machine.breakpoints.discard)(address)

    def set_watchpoint(self, address: int, count: int, kind: WatchKind, on: bool) -> None:
        watch = Watch(address, count, WATCHES[kind])
        self.machine.watch(watch, on)
        if on:
            self._watches[address, count, kind] = watch
        else:
            self._watches.pop((address, count, kind), None)

    def restart(self) -> None:
        self._halt(Reason())
        self.reset()

    def monitor(self, command: str) -> str:
        words = command.split()
        if words in ([], ["help"]):
            return f"{debugger_commands.HELP}\n{self.command(['help'])}"
        output = debugger_commands.perform(self, words)
        return self.command(words) if output is None else output

    def catch_faults(self, mask: int) -> None:
        """Halt at these exceptions, bits VC_* of DEMCR, before their handlers run."""
        self.machine.attach_debugger(True, mask)

    def answer_semihosting(self, on: bool) -> None:
        self.machine.semihosting(on)
