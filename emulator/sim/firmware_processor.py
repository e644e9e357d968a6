"""Runs a user's own firmware in virtual time.

The machine runs alone up to the kernel's next event, so no input comes late. It returns sooner when
it has an output; the kernel catches up to that picosecond, the board handles the output, and the
machine continues. While it sleeps, the kernel goes from event to event without it.
"""

import logging
from collections import Counter
from collections.abc import Callable, Generator, Mapping
from dataclasses import KW_ONLY, dataclass, field
from typing import Any, Protocol

import simpy

from cubestack.emulator.iss.insight.fault_report import fault_report, last_fault, unhandled
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import NEVER, Machine
from cubestack.emulator.iss.outcome import Outgoing, OutgoingKind, Stop, StopReason
from cubestack.emulator.iss.semihosting import Exit, SemihostingHost
from cubestack.emulator.sim.firmware_fpga import FpgaCoupling
from cubestack.emulator.sim.fpga_port import FpgaPort
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S, PS_PER_US, Kernel

LOOK_AHEAD_PS = 80 * PS_PER_US
"""Default of the longest run of a machine."""

QUANTUM_PS = 10 * PS_PER_US
"""Run of a machine that takes turns with another one at the same picosecond."""

QUIET_PS = 2 * PS_PER_S
"""A program that now sleeps and sent nothing for this time waits for input."""

QUIET_AWAKE_PS = 5 * PS_PER_S
"""The same for a program that never sleeps: it computes, or polls."""

FAULT_CHECK_PS = 10 * PS_PER_MS
"""Period of the check whether the program hangs in a fault handler."""

INPUT_POLL_PS = 10 * PS_PER_MS
"""Period in which a program that waits for console input looks for it."""

MOST_STANDING = 3
"""Consecutive runs in which a machine may make no progress."""

INWARD = frozenset({OutgoingKind.SLEEP, OutgoingKind.LOG})
"""Outputs that do not count as activity visible outside."""

logger = logging.getLogger(__name__)

Steps = Generator[simpy.Event, Any, None]


class Debugger(Protocol):
    """Runs the machine in place of the processor, and may halt it."""

    def run(self, until_ps: int) -> Stop: ...

    def program_ended(self) -> None: ...


@dataclass(eq=False)
class FirmwareProcessor:
    """One microcontroller with the user's own firmware.

    Attributes:
        machine: the microcontroller, loaded, in reset.
        handlers: called with the machine's outputs, by their kind.
        causes: the part's reset cause bits, by the cause given to ``reset``.
        couple: connects the machine's pins to an FPGA.
        look_ahead_ps: longest run of the machine: less than the time of a byte on the wires, so
            what a host begins to send while the machine is ahead arrives after the run. Longer
            where the host does nothing before ``Kernel.idle_until`` and nobody watches steps.
        on_activity: called when the core falls asleep (False) or wakes (True).
        console: receives the text that the program prints on its debug channels, line by line.
        on_fault: called with a text when a fault stops the program for good.
        on_exit: called with the status of a program that ends by semihosting; it runs no further.
        host: answers semihosting calls, if the machine has them enabled.
        debugger: runs the machine, if not None.
        resets: number of resets since power-up.
        energy_mode: 0 awake, else the energy mode (EM1 to EM4) of the sleep.
    """

    env: Kernel
    machine: Machine
    _: KW_ONLY
    power_on: int = 1
    handlers: Mapping[OutgoingKind, Callable[[Outgoing], None]] = field(default_factory=dict)
    causes: Mapping[int, int] = field(default_factory=dict)
    couple: Callable[[FpgaPort], FpgaCoupling] | None = None
    look_ahead_ps: int = LOOK_AHEAD_PS
    on_activity: Callable[[bool], None] = lambda _awake: None
    console: Callable[[str], None] = logger.info
    on_fault: Callable[[str], None] = logger.error

    def __post_init__(self) -> None:
        self.debugger: Debugger | None = None
        self.on_exit: Callable[[int], None] = self._report_exit
        self.host = SemihostingHost(self.machine)
        self.host.write = lambda data: self._print(-1, data)
        self._call: Outgoing | None = None  # that has no answer yet
        self._exited = False
        self.resets = self.energy_mode = 0
        self._fpga: FpgaPort | None = None
        self._coupling: FpgaCoupling | None = None
        self._input = self.env.event()
        self._awake = True
        self._active_ps = 0
        self._lines: dict[int, str] = {}
        self._early: list[Outgoing] = []  # outputs from ``catch_up``
        self._locked_up = False
        self._check_ps = self._reported_faults = 0
        self._faults = Counter[tuple[int, int, int]]()
        self._unwanted_resets = Counter[str]()
        self.machine.reset(self.power_on)
        for _ in self.machine.outbox():
            pass  # outputs of the initial reset concern nobody
        self.on_activity(True)
        self._running = self.env.process(self._run())

    # --- used by boards, faults and hosts -------------------------------------------------------

    @property
    def fpga(self) -> FpgaPort | None:
        return self._fpga

    @fpga.setter
    def fpga(self, fpga: FpgaPort | None) -> None:
        self._fpga = fpga
        self._coupling = self.couple(fpga) if self.couple is not None and fpga is not None else None

    @property
    def dozing(self) -> bool:
        return not self._awake

    @property
    def waiting(self) -> bool:
        """Whether nothing happens without input from outside.

        A program sleeps between ticks as well as between telecommands. A sleeping program counts as
        waiting when no event is due within ``QUIET_PS``, or it had no output for that time.
        """
        now_ps = self.env.now
        if self._locked_up or self._exited or self._call is not None:
            return True
        if self._awake:
            return now_ps > self._active_ps + QUIET_AWAKE_PS
        due_ps = self.machine.next_event_ps
        return due_ps >= now_ps + QUIET_PS or now_ps > self._active_ps + QUIET_PS

    def reset(self, cause: int, hang_us: int = 0) -> None:
        """Reset with one of ``causes``.

        With ``hang_us`` the program hangs instead, until its own watchdog resets it.
        """
        self.catch_up()
        if hang_us:
            self._exited = True
            self.machine.hang()
            self.machine.answer_call(0)
        else:
            self.machine.reset(self.causes[cause])
        self.wake()

    def catch_up(self) -> None:
        """Run the machine to the kernel's time; call before changing its inputs."""
        standing = 0  # a run may only wake the machine, or stop for an output
        while standing < MOST_STANDING and self.machine.now_ps < self.env.now:
            if self.env.paused:
                break
            before_ps = self.machine.now_ps
            self._run_machine(self.env.now)
            self._early.extend(self.machine.outbox())
            standing = 0 if self.machine.now_ps > before_ps else standing + 1

    def wake(self) -> None:
        """Report changed inputs, so that a sleeping machine runs."""
        if not self._input.triggered:
            self._input.succeed()

    def change_inputs(self, act: Callable[[], None]) -> None:
        """Change the machine's inputs by ``act`` at the kernel's time."""
        self.catch_up()
        act()
        self.wake()

    # --------------------------------------------------------------------------------------------

    def _run(self) -> Steps:
        env, standing = self.env, 0
        reached_ps = self.machine.now_ps
        while True:
            if self._call is not None:
                yield env.timeout(INPUT_POLL_PS)
                yield from self._empty_outbox()  # a reset ends the call
                if self._call is not None:
                    self._answer_call(self._call)
                continue
            if env.horizon() == env.now:
                yield env.timeout(0)  # all other processes that are due now run first
            stop = self._run_machine(self._run_limit_ps())
            while env.paused:  # by the debugger; then continue as if it had not stopped
                yield env.urgent(env.now)
                if stop.sends or self._early:
                    break
                stop = self._run_without_hook(self._run_limit_ps())
            yield from self._settle(stop)
            # After an output its interrupt may be pending, which wakes it at once.
            if not self._awake and not stop.sends and self._sleeps(stop):
                yield from self._sleep()
                continue
            ahead_ps = stop.now_ps - env.now
            standing = standing + 1 if stop.now_ps == reached_ps and ahead_ps <= 0 else 0
            reached_ps = stop.now_ps
            if standing >= MOST_STANDING:  # such a machine must not block the kernel
                yield from self._await_input(self._run_limit_ps())
                continue
            yield env.timeout(max(0, ahead_ps))

    def _run_machine(self, until_ps: int) -> Stop:
        if self._coupling is not None:
            self._coupling.before_run()
        return self._run_without_hook(until_ps)

    def _run_without_hook(self, until_ps: int) -> Stop:
        """Run without ``before_run``, which is done already."""
        runner = self.machine if self.debugger is None else self.debugger
        stop = runner.run(until_ps)
        if stop.reason is StopReason.LOCKED_UP and not self._locked_up:
            self._report_fault("the core is locked up")
        self._locked_up = stop.reason is StopReason.LOCKED_UP
        if stop.now_ps >= self._check_ps:
            self._check_ps = stop.now_ps + FAULT_CHECK_PS
            self._check_for_fault()
        return stop

    def _check_for_fault(self) -> None:
        """Report a fault whose handler does nothing, once per fault."""
        if unhandled(self.machine) and last_fault(self.machine).count != self._reported_faults:
            self._reported_faults = last_fault(self.machine).count
            self._report_fault("the firmware does not handle a fault")

    def _report_fault(self, what: str) -> None:
        """Report a fault in full the first time; repetitions in one line, at powers of ten."""
        fault = last_fault(self.machine)
        kind = fault.pc, fault.cfsr, fault.hfsr
        self._faults[kind] += 1
        times = self._faults[kind]
        if times == 1:
            symbols = Symbols.of(self.machine.image)
            self.on_fault(f"{what}\n{fault_report(self.machine, symbols, self.machine.now_ps)}")
        elif _is_power_of_ten(times):
            self.on_fault(f"{what}: the same fault, {times} times now")

    def _report_reset(self, what: str) -> None:
        """Report a reset that the program did not request; repetitions at powers of ten."""
        self._unwanted_resets[what] += 1
        times = self._unwanted_resets[what]
        if _is_power_of_ten(times):
            self.on_fault(what if times == 1 else f"{what}, {times} times now")

    def _run_limit_ps(self) -> int:
        """The time before which no other event happens."""
        now_ps, horizon = self.env.now, self.env.horizon()
        ahead_ps = now_ps + self.look_ahead_ps
        if not self.env.watched:
            ahead_ps = max(ahead_ps, self.env.idle_until)
        if horizon is None:
            return ahead_ps
        if horizon <= now_ps:
            return now_ps + QUANTUM_PS
        return min(horizon, ahead_ps)

    def _sleeps(self, stop: Stop) -> bool:
        machine = self.machine
        return machine.asleep and machine.next_event_ps > max(stop.now_ps, self.env.now)

    def _sleep(self) -> Steps:
        due_ps = self.machine.next_event_ps
        yield from self._await_input(None if due_ps == NEVER else max(due_ps, self.env.now))

    def _await_input(self, until_ps: int | None) -> Steps:
        alternatives: list[simpy.Event] = [self._input]
        if until_ps is not None and not self._input.triggered:
            alternatives.append(self.env.timeout(until_ps - self.env.now))
        yield simpy.AnyOf(self.env, alternatives)
        if self._input.triggered:
            self._input = self.env.event()

    # --- outputs of the machine -----------------------------------------------------------------

    def _settle(self, stop: Stop) -> Steps:
        if stop.sends or self._early or self.debugger is not None:
            yield from self._empty_outbox()
        if self._coupling is not None:
            self._coupling.after_run(stop.now_ps)

    def _empty_outbox(self) -> Steps:
        early, self._early = self._early, []
        for one in (*early, *self.machine.outbox()):
            if one.time_ps > self.env.now:
                yield self.env.timeout(one.time_ps - self.env.now)
            if self._coupling is not None:
                self._coupling.after_run(max(self.env.now, one.time_ps))
            self._handle(one)

    def _handle(self, one: Outgoing) -> None:
        if one.kind not in INWARD:
            self._active_ps = one.time_ps
        match one.kind:
            case OutgoingKind.SLEEP:
                self.energy_mode = one.value
                awake = one.value == 0
                if awake != self._awake:
                    self._awake = awake
                    self.on_activity(awake)
            case OutgoingKind.RESET:
                self.resets += 1
                self._locked_up = False
                self._call, self._exited = None, False
                self._reported_faults = 0
                if one.text:
                    self._report_reset(one.text)
            case OutgoingKind.ITM:
                self._print(one.unit, one.value.to_bytes(8, "little")[: max(1, one.extra)])
            case OutgoingKind.SEMIHOSTING:
                self._answer_call(one)
            case OutgoingKind.LOG:
                logger.warning("%s", one.text)
            case OutgoingKind.FAULT:
                self.on_fault(one.text)
        handler = self.handlers.get(one.kind)
        if handler is not None:
            handler(one)

    def _answer_call(self, call: Outgoing) -> None:
        """Answer a semihosting call, or keep it until there is input."""
        result = self.host.call(call.unit, call.value, call.time_ps)
        self._call = call if result is None else None
        if isinstance(result, Exit):
            self.machine.hang()
            self._print(-1, b"\n" if self._lines.get(-1) else b"")
            if self.debugger is not None:
                self.debugger.program_ended()
            self.on_exit(result.status)
        elif result is not None:
            self.machine.answer_call(result)

    def _report_exit(self, status: int) -> None:
        self.on_fault(f"the program exited by semihosting with status {status}")

    def _print(self, channel: int, data: bytes) -> None:
        text = self._lines.get(channel, "") + data.decode("latin-1")
        *lines, self._lines[channel] = text.split("\n")
        for line in lines:
            self.console(line.rstrip("\r"))


def _is_power_of_ten(times: int) -> bool:
    """Whether ``times`` is 1, 10, 100 and so on."""
    return str(times).strip("0") == "1"
