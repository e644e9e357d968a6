"""Faults of the satellite's serial line and I2C bus."""

import errno
from collections.abc import Callable, Generator
from typing import Any

import simpy

from cubestack.emulator.bus.i2c import LONGEST_STRETCH_PS, I2cBus, I2cError
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.faults import table
from cubestack.emulator.faults.injection import Injection, Mechanism, Report, active
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S, PS_PER_US, Kernel

Steps = Generator[simpy.Event, Any, None]


class LineFaults(Mechanism):
    """Loses, changes and delays bytes on a serial line, in both directions."""

    def __init__(self, env: Kernel, report: Report, uart: Uart) -> None:
        super().__init__(env, report)
        self._host_free_ps = self._device_free_ps = 0
        uart.fault_hook = self

    def prepare(self, injection: Injection) -> None:
        """Store it until after its end, as a byte is hit if the fault was active at its start."""
        past_ps = self.env.now - PS_PER_S
        self.injections = [
            known for known in self.injections if known.end_ps is None or known.end_ps > past_ps
        ]
        self.injections.append(injection)

    def end(self, injection: Injection) -> None:
        """Kept: a byte may have begun before."""

    def to_host(
        self, data: bytes, first_ps: int, byte_ps: int, line: Callable[[bytes, int, int], None]
    ) -> None:
        last_ps = first_ps + (len(data) - 1) * byte_ps
        near = any(
            injection.start_ps <= last_ps
            and (injection.end_ps is None or first_ps - byte_ps < injection.end_ps)
            for injection in self.injections
        )
        if not near and first_ps >= self._host_free_ps:
            line(data, first_ps, byte_ps)
            return
        for index, byte in enumerate(data):
            due_ps = first_ps + index * byte_ps
            arrived, delay_ps = self._disturb(byte, due_ps - byte_ps, "to-host")
            if arrived is not None:
                arrival_ps = max(due_ps + delay_ps, self._host_free_ps)
                self._host_free_ps = arrival_ps + byte_ps
                line(bytes([arrived]), arrival_ps, byte_ps)

    def to_device(self, byte: int, start_ps: int, receive: Callable[[int, int], None]) -> None:
        arrived, delay_ps = self._disturb(byte, start_ps, "to-device")
        if arrived is None:
            return
        now_ps = self.env.now
        due_ps = max(now_ps + delay_ps, self._device_free_ps)
        if due_ps == now_ps:
            receive(arrived, start_ps)
            return
        self._device_free_ps = due_ps + (now_ps - start_ps)
        self.env.process(self._receive_later(due_ps, arrived, start_ps, receive))

    def _receive_later(
        self, due_ps: int, byte: int, start_ps: int, receive: Callable[[int, int], None]
    ) -> Steps:
        held_ps = due_ps - self.env.now
        yield self.env.timeout(held_ps)
        receive(byte, start_ps + held_ps)

    def _disturb(self, byte: int, start_ps: int, way: str) -> tuple[int | None, int]:
        """The changed byte, or None, and its delay in ps."""
        delay_ps = 0
        for injection in self.injections:
            fault = injection.fault
            assert isinstance(fault, table.UartDrop | table.UartCorrupt | table.UartDelay)
            acts = fault.direction in ("both", way) and injection.active(start_ps)
            if not acts or not injection.has_effect(fault.rate):
                continue
            match fault:
                case table.UartDrop():
                    self.report(start_ps, injection, f"{byte:#04x} {way} lost")
                    return None, 0
                case table.UartCorrupt():
                    mask = fault.mask or 1 << int(injection.generator.integers(8))
                    self.report(start_ps, injection, f"{byte:#04x} {way} is {byte ^ mask:#04x}")
                    byte ^= mask
                case table.UartDelay():
                    self.report(start_ps, injection, f"{byte:#04x} {way} held up")
                    delay_ps += round(fault.delay_ms * PS_PER_MS)
        return byte, delay_ps


class BusFaults(Mechanism):
    """Missing acknowledges, stretched clocks and stuck lines; transfers fail as on Linux."""

    def __init__(self, env: Kernel, report: Report, bus: I2cBus) -> None:
        super().__init__(env, report)
        bus.fault_hook = self

    def prepare(self, injection: Injection) -> None:
        self.injections.append(injection)

    def before_start(self) -> Steps:
        """Wait until both lines are high; EBUSY if one is low for over 1 s."""
        give_up_ps = self.env.now + LONGEST_STRETCH_PS
        while (held := self._stuck_line()) is not None:
            injection, fault = held
            self.report(self.env.now, injection, f"{fault.line} is low, no start is possible")
            error = I2cError(errno.EBUSY, f"I2C line {fault.line} was low for over 1 s")
            yield from self._wait_for_end(injection, give_up_ps, error)

    def after_address(self, address: int) -> Steps:
        """Fail as without a target, or if a line is held."""
        yield from self._wait_for_lines(address)
        if self._nack("address"):
            raise I2cError(errno.ENXIO, f"no I2C device answers at {address:#04x}")

    def after_byte(self, address: int, read: bool) -> Steps:
        """Stretch the clock, or reject a byte from the host."""
        yield from self._wait_for_lines(address)
        for injection, fault in active(self.injections, table.I2cStretch, self.env.now):
            if injection.has_effect(fault.rate):
                stretch_ps = round(fault.stretch_us * PS_PER_US)
                self.report(self.env.now, injection, f"{fault.stretch_us:g} us")
                yield self.env.timeout(min(stretch_ps, LONGEST_STRETCH_PS))
                if stretch_ps > LONGEST_STRETCH_PS:
                    raise _timeout(address)
        if not read and self._nack("byte"):
            raise I2cError(errno.EIO, f"I2C device {address:#04x} did not acknowledge a byte")

    def _stuck_line(self) -> tuple[Injection, table.I2cStuck] | None:
        return next(iter(active(self.injections, table.I2cStuck, self.env.now)), None)

    def _wait_for_lines(self, address: int) -> Steps:
        """Within a transfer, SCL held low stretches the clock; SDA held low is another host."""
        give_up_ps = self.env.now + LONGEST_STRETCH_PS
        while (held := self._stuck_line()) is not None:
            injection, fault = held
            self.report(self.env.now, injection, f"{fault.line} is low in a transfer")
            if fault.line == "SDA":
                raise I2cError(errno.EAGAIN, "I2C arbitration lost: SDA is held low")
            yield from self._wait_for_end(injection, give_up_ps, _timeout(address))

    def _wait_for_end(self, injection: Injection, give_up_ps: int, error: I2cError) -> Steps:
        until_ps = give_up_ps if injection.end_ps is None else injection.end_ps
        yield self.env.timeout(min(until_ps, give_up_ps) - self.env.now)
        if self.env.now >= give_up_ps:
            raise error

    def _nack(self, on: str) -> bool:
        for injection, fault in active(self.injections, table.I2cNack, self.env.now):
            if fault.on == on and injection.has_effect(fault.rate):
                self.report(self.env.now, injection, f"{on} not acknowledged")
                return True
        return False


def _timeout(address: int) -> I2cError:
    return I2cError(errno.ETIMEDOUT, f"I2C device {address:#04x} held the clock low for over 1 s")
