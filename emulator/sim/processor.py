"""Runs a firmware program in virtual time: spends its cycles and performs its requests.

While the processor waits for the FPGA, the FPGA runs ahead of the kernel, in bursts that end at
the next scheduled event, at most ``LOOK_AHEAD_PS`` ahead. An event that is scheduled from outside
during a burst (a host starts to write) reaches the FPGA late by at most that time.
"""

from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import KW_ONLY, dataclass
from fractions import Fraction
from functools import lru_cache
from math import ceil
from typing import Any, Protocol

import numpy as np
import simpy

from cubestack.emulator.sim.fpga_port import FpgaPort, Transactions
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S, PS_PER_US, CycleClock, Kernel
from cubestack.firmware_model.interface.checks import shown_path
from cubestack.firmware_model.mcu import requests
from cubestack.firmware_model.mcu.costs import Meter

LOOK_AHEAD_PS = 10 * PS_PER_MS

Steps = Generator[simpy.Event, Any, Any]


class RequestError(ValueError):
    """A program requests what cannot be; the line says where."""


class Program(Protocol):
    """A firmware program: its main routine never returns, it ends in a ``Reset`` request."""

    def main(self) -> requests.Routine[None]: ...


class CameraBus(Protocol):
    """The bus over which the processor controls the camera."""

    def transfer_ps(self, request: requests.CameraTransfer) -> int:
        """Time for which ``request`` occupies the bus, in ps."""

    def transfer(self, request: requests.CameraTransfer, now_ps: int) -> bytes | None:
        """Perform ``request``, which ends at ``now_ps``; None if not acknowledged."""


class Pins(Protocol):
    """Pins of the processor that do not lead to the FPGA."""

    def __contains__(self, pin: object) -> bool: ...

    def set_pin(self, pin: str, level: int) -> None: ...

    def get_pin(self, pin: str) -> int: ...


@dataclass(eq=False)
class Processor:
    """One microcontroller: a clock, a program, and the pins it shares with the FPGA.

    Attributes:
        meter: counts the cycles that the program charges; its table has the clock frequency.
        fpga: the FPGA at the processor's pins; if None, requests that need one raise ValueError.
        camera_bus: the camera's control bus; None where the program drives its lines as pins.
        boot: creates the program after a reset, from the cause (see ``Reset``).
        power_on_cause: cause of the first start.
        boot_us: time from reset to the first instruction of ``main``.
        other_pins: pins that do not lead to the FPGA.
        on_pin: called after each change of an output pin.
        on_activity: called when the processor falls asleep (False), starts or wakes (True).
        on_access: called when the program begins to use the external bus (True), and at its next
            request of another kind (False).
        on_forced_reset: called at a reset that the program did not request.
        program: the running program, for the interrupt lines of the peripherals.
        resets: number of resets since power-up.
        waiting: asleep until an interrupt, with no deadline.
        dozing: asleep until an interrupt, with or without a deadline.
    """

    env: Kernel
    meter: Meter
    fpga: FpgaPort | None
    camera_bus: CameraBus | None
    boot: Callable[[int], Program]
    _: KW_ONLY
    power_on_cause: int
    boot_us: int
    other_pins: Pins | None = None
    on_pin: Callable[[str, int], None] = lambda _pin, _level: None
    on_activity: Callable[[bool], None] = lambda _busy: None
    on_access: Callable[[bool], None] = lambda _busy: None
    on_forced_reset: Callable[[], None] = lambda: None

    def __post_init__(self) -> None:
        self._accesses = False
        self._forced = 0, 0
        self._clock = CycleClock(self.meter.table.clock_hz)
        self._wake = self.env.event()
        self.resets = 0
        self.waiting = self.dozing = False
        self.program = self.boot(self.power_on_cause)
        self._running = self.env.process(self._run())

    def wake(self) -> None:
        """End the current wakeable sleep, or the next one at once."""
        if not self._wake.triggered:
            self._wake.succeed()

    def reset(self, cause: int, hang_us: int = 0) -> None:
        """Reset now, or after the program has hung for ``hang_us`` with interrupts served."""
        self._forced = cause, hang_us
        self._running.interrupt()

    def load(self, select: int, address: int, count: int, cycles: int) -> bytes:
        """Read bytes over the external bus in an interrupt, which charges their cycles later.

        Each takes ``cycles``. The FPGA is ahead of the kernel until the cycles are paid.
        """
        self._follow()
        addresses = np.arange(address, address + count, dtype=np.int32)
        data = np.zeros(count, np.uint8)
        reads = Transactions(addresses, data, False, self._cycle, cycles, select)
        self._port.access(reads, self._port.now_ps + int(count * reads.period))
        return reads.data.tobytes()

    def _run(self) -> Steps:
        self.on_activity(True)
        while True:
            try:
                yield self.env.timeout(self.boot_us * PS_PER_US)
                cause = yield from self._execute(self.program)
            except simpy.Interrupt:
                cause = yield from self._handle_resets()
            self.resets += 1
            self._wake = self.env.event()  # a reset clears pending interrupts
            self.program = self.boot(cause)

    def _handle_resets(self) -> Steps:
        """Handle ``reset``; returns the cause of the reset that comes first."""
        cause, hang_us = self._forced
        self.waiting = self.dozing = False
        self.on_activity(True)
        try:
            yield self.env.timeout(hang_us * PS_PER_US)
        except simpy.Interrupt:
            return (yield from self._handle_resets())
        if self._accesses:
            self._accesses = False
            self.on_access(False)
        self._follow()
        self.on_forced_reset()
        self.meter.take()
        return cause

    def _execute(self, program: Program) -> Steps:
        answer: object = None
        with closing(program.main()) as routine:
            while True:
                try:
                    request = routine.send(answer)
                except StopIteration:
                    text = f"{program!r} returned from main: it must end in Reset"
                    raise RuntimeError(text) from None
                yield from self._spend_cycles()
                if isinstance(request, requests.Reset):
                    return request.cause
                try:
                    answer = yield from self._perform(request)
                except ValueError as error:
                    raise RequestError(f"{_place(routine)}: {error}") from error

    def _spend_cycles(self) -> Steps:
        """Stay busy for the charged cycles, and for those that interrupts charge meanwhile."""
        while cycles := self.meter.take():
            yield self.env.timeout(self._clock.elapse(cycles))

    def _perform(self, request: requests.Request) -> Steps:
        if self._accesses != isinstance(request, requests.BusAccess):
            self._accesses = not self._accesses
            self.on_access(self._accesses)
        match request:
            case requests.Pay():
                return None
            case requests.ReadTimer():
                return self.env.now // PS_PER_US
            case requests.SetPin(pin, level):
                self._pins_of(request).set_pin(pin, level)
                self.meter.charge(port_write=1)
                self.on_pin(pin, level)
                return None
            case requests.ReadPin(pin):
                self.meter.charge(port_read=1)
                return self._pins_of(request).get_pin(pin)
            case requests.AwaitPin():
                return (yield from self._await_pin(request))
            case requests.Sleep():
                return (yield from self._sleep(request))
            case requests.StrobeRead():
                return (yield from self._strobe_read(request))
            case requests.BusAccess():
                return (yield from self._bus_access(request))
            case requests.CameraTransfer():
                assert self.camera_bus is not None
                yield self.env.timeout(self.camera_bus.transfer_ps(request))
                self._follow()
                return self.camera_bus.transfer(request, self.env.now)
            case _:
                raise ValueError(
                    f"a program must yield a request, not {request!r}; a routine takes `yield from`"
                )

    @property
    def _cycle(self) -> Fraction:
        return _ps(1, self._clock.hz)

    def _follow(self) -> None:
        """Run the FPGA to the kernel's time; after accesses in an interrupt it is ahead."""
        if self.fpga is not None:
            self.fpga.run(max(self.env.now, self.fpga.now_ps))

    @property
    def _port(self) -> FpgaPort:
        """The FPGA; read anew after each wait, as a fault may have replaced it."""
        if self.fpga is None:
            raise ValueError("this board has no FPGA, but its program requests access to one")
        return self.fpga

    def _pins_of(self, request: requests.SetPin | requests.ReadPin) -> Pins | FpgaPort:
        self._follow()
        if self.other_pins is not None and request.pin in self.other_pins:
            return self.other_pins
        if self.fpga is None:
            raise ValueError(f"this board has no FPGA, and no pin {request.pin} of its own")
        return self.fpga

    def _horizon(self) -> int:
        """Limit for the FPGA's look-ahead: nothing else happens before this time."""
        limit = self.env.now + LOOK_AHEAD_PS
        horizon = self.env.horizon()
        return limit if horizon is None else min(limit, horizon)

    def _await_pin(self, request: requests.AwaitPin) -> Steps:
        start = self.env.now
        deadline = start + request.timeout_us * PS_PER_US
        self._follow()
        reached = start
        while self._port.get_pin(request.pin) != request.level:
            if self.env.now >= deadline:
                return False
            until = max(self._port.now_ps, min(deadline, self._horizon()))
            reached = self._port.run(until, (request.pin, request.level))
            yield self.env.timeout(reached - self.env.now)
        poll = request.poll_cycles * PS_PER_S
        polls = max(1, -(-(reached - start) * self._clock.hz // poll))
        yield self.env.timeout(start + polls * poll // self._clock.hz - self.env.now)
        return True

    def _sleep(self, request: requests.Sleep) -> Steps:
        if request.deadline_us is None and not request.wakeable:
            raise ValueError(f"nothing can end {request!r}: give a deadline or make it wakeable")
        deadline = None if request.deadline_us is None else request.deadline_us * PS_PER_US
        if deadline is not None and deadline <= self.env.now:
            return False
        alternatives: list[simpy.Event] = [self._wake] if request.wakeable else []
        if deadline is not None:
            alternatives.append(self.env.timeout(deadline - self.env.now))
        self.waiting, self.dozing = deadline is None, request.wakeable
        self.on_activity(False)
        yield simpy.AnyOf(self.env, alternatives)
        self.on_activity(True)
        self.waiting = self.dozing = False
        if request.wakeable and self._wake.triggered:
            self._wake = self.env.event()
            return True
        return False

    def _strobe_read(self, request: requests.StrobeRead) -> Steps:
        period = _ps(request.cycles, self._clock.hz)
        done = 0
        while done < len(request.target):
            yield from self._spend_cycles()
            self._follow()
            fpga = self._port
            # At least one cycle: an event within it is an interrupt in the middle of the loop.
            limit = max(self._horizon(), self.env.now + ceil(period))
            done += fpga.strobe_read(request.target[done:], period, limit)
            yield self.env.timeout(fpga.now_ps - self.env.now)
        return None

    def _bus_access(self, request: requests.BusAccess) -> Steps:
        done, total = 0, len(request.addresses)
        while done < total:
            yield from self._spend_cycles()
            self._follow()
            fpga = self._port
            addresses, data = request.addresses[done:], request.data[done:]
            timing = self._cycle, request.cycles, request.select, request.above
            wanted = Transactions(addresses, data, request.write, *timing)
            # At least one transaction, as above.
            done += fpga.access(wanted, max(self._horizon(), fpga.now_ps + ceil(wanted.period)))
            yield self.env.timeout(fpga.now_ps - self.env.now)
            if not request.write and request.data[done - 1] > request.above:
                break
        return done


@lru_cache(maxsize=64)  # a processor has few loops, but runs each many times
def _ps(cycles: int, hz: int) -> Fraction:
    return Fraction(cycles * PS_PER_S, hz)


def _place(routine: Any) -> str:
    """File and line where a program waits for the answer to a request."""
    while hasattr(getattr(routine, "gi_yieldfrom", None), "gi_frame"):
        routine = routine.gi_yieldfrom
    code, frame = getattr(routine, "gi_code", None), getattr(routine, "gi_frame", None)
    return f"{shown_path(code.co_filename)}:{frame.f_lineno}" if code and frame else repr(routine)
