"""Faults of the satellite's lines: what stands in a UART's line, and on an I2C bus."""

import errno
from collections.abc import Callable, Generator
from typing import Any

import simpy

from cubestack.emulator.bus.i2c import LONGEST_STRETCH_PS, I2cBus, I2cError
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.faults.injection import Injection, Report
from cubestack.emulator.faults.table import (
    I2cNack,
    I2cStretch,
    I2cStuck,
    UartCorrupt,
    UartDelay,
    UartDrop,
)
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S, PS_PER_US, Kernel

Steps = Generator[simpy.Event, Any, None]


class LineFaults:
    """In a serial line: loses, changes and holds up bytes of both directions."""

    def __init__(self, env: Kernel, uart: Uart, report: Report) -> None:
        """Get in between; the line is as before as long as no fault acts."""
        self._env = env
        self._report = report
        self._injections: list[Injection] = []
        self._host_free_ps = 0
        self._device_free_ps = 0
        uart.fault_hook = self

    def prepare(self, injection: Injection) -> None:
        """Know of a fault ahead, and after its end: a byte is judged by when it began."""
        past_ps = self._env.now - PS_PER_S
        self._injections = [
            known for known in self._injections if known.end_ps is None or known.end_ps > past_ps
        ]
        self._injections.append(injection)

    def begin(self, injection: Injection) -> None:
        """Nothing happens before a byte comes."""

    def end(self, injection: Injection) -> None:
        """A byte may have begun before."""

    def to_host(
        self, data: bytes, first_ps: int, byte_ps: int, line: Callable[[bytes, int, int], None]
    ) -> None:
        """Hand ``line`` what arrives of ``data``, of which the first byte ends at ``first_ps``."""
        last_ps = first_ps + (len(data) - 1) * byte_ps
        near = any(
            injection.start_ps <= last_ps
            and (injection.end_ps is None or first_ps - byte_ps < injection.end_ps)
            for injection in self._injections
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

    def to_device(self, byte: int, start_ps: int, hear: Callable[[int, int], None]) -> None:
        """Tell ``hear`` what arrives of a byte that began at ``start_ps``, now or later."""
        arrived, delay_ps = self._disturb(byte, start_ps, "to-device")
        if arrived is None:
            return
        now_ps = self._env.now
        due_ps = max(now_ps + delay_ps, self._device_free_ps)
        if due_ps == now_ps:
            hear(arrived, start_ps)
            return
        self._device_free_ps = due_ps + (now_ps - start_ps)
        self._env.process(self._later(due_ps, arrived, start_ps, hear))

    def _later(
        self, due_ps: int, byte: int, start_ps: int, hear: Callable[[int, int], None]
    ) -> Steps:
        held_ps = due_ps - self._env.now
        yield self._env.timeout(held_ps)
        hear(byte, start_ps + held_ps)

    def _disturb(self, byte: int, start_ps: int, way: str) -> tuple[int | None, int]:
        """What becomes of a byte, and by how much it is late."""
        delay_ps = 0
        for injection in self._injections:
            fault = injection.fault
            assert isinstance(fault, UartDrop | UartCorrupt | UartDelay)
            if fault.direction not in ("both", way) or not injection.active(start_ps):
                continue
            if not injection.strikes(fault.rate):
                continue
            match fault:
                case UartDrop():
                    self._report(start_ps, injection, f"{byte:#04x} {way} lost")
                    return None, 0
                case UartCorrupt():
                    mask = fault.mask or 1 << int(injection.generator.integers(8))
                    self._report(start_ps, injection, f"{byte:#04x} {way} is {byte ^ mask:#04x}")
                    byte ^= mask
                case UartDelay():
                    self._report(start_ps, injection, f"{byte:#04x} {way} held up")
                    delay_ps += round(fault.delay_ms * PS_PER_MS)
        return byte, delay_ps


class BusFaults:
    """On an I2C bus: refuses, stretches and holds lines; whole transfers fail as on Linux."""

    def __init__(self, env: Kernel, bus: I2cBus, report: Report) -> None:
        """Listen to the bus."""
        self._env = env
        self._report = report
        self._injections: list[Injection] = []
        bus.fault_hook = self

    def prepare(self, injection: Injection) -> None:
        """Know of a fault ahead."""
        self._injections.append(injection)

    def begin(self, injection: Injection) -> None:
        """Nothing happens before a transfer."""

    def end(self, injection: Injection) -> None:
        """Forget it."""
        self._injections.remove(injection)

    def before_start(self) -> Steps:
        """Wait until both lines are high; EBUSY for one that is low for over 1 s."""
        give_up_ps = self._env.now + LONGEST_STRETCH_PS
        while (held := self._stuck()) is not None:
            line, injection = held
            self._report(self._env.now, injection, f"{line} is low, no start is possible")
            error = I2cError(errno.EBUSY, f"I2C line {line} was low for over 1 s")
            yield from self._wait_for_end(injection, give_up_ps, error)

    def after_address(self, address: int) -> Steps:
        """Fail as where nobody answers, or where a line is held."""
        yield from self._lines_free(address)
        if self._nack("address"):
            raise I2cError(errno.ENXIO, f"no I2C device answers at {address:#04x}")

    def after_byte(self, address: int, read: bool) -> Steps:
        """Stretch the clock, or refuse a byte that the host writes."""
        yield from self._lines_free(address)
        for injection in self._acting():
            fault = injection.fault
            if isinstance(fault, I2cStretch) and injection.strikes(fault.rate):
                stretch_ps = round(fault.stretch_us * PS_PER_US)
                self._report(self._env.now, injection, f"{fault.stretch_us:g} us")
                yield self._env.timeout(min(stretch_ps, LONGEST_STRETCH_PS))
                if stretch_ps > LONGEST_STRETCH_PS:
                    raise _timeout(address)
        if not read and self._nack("byte"):
            raise I2cError(errno.EIO, f"I2C device {address:#04x} refused a byte")

    def _acting(self) -> list[Injection]:
        return [injection for injection in self._injections if injection.active(self._env.now)]

    def _stuck(self) -> tuple[str, Injection] | None:
        for injection in self._acting():
            if isinstance(injection.fault, I2cStuck):
                return injection.fault.line, injection
        return None

    def _lines_free(self, address: int) -> Steps:
        """Within a transfer: SCL held low stretches the clock, SDA held low is another host."""
        give_up_ps = self._env.now + LONGEST_STRETCH_PS
        while (held := self._stuck()) is not None:
            line, injection = held
            self._report(self._env.now, injection, f"{line} is low in a transfer")
            if line == "SDA":
                raise I2cError(errno.EAGAIN, "I2C arbitration lost: SDA is held low")
            yield from self._wait_for_end(injection, give_up_ps, _timeout(address))

    def _wait_for_end(self, injection: Injection, give_up_ps: int, error: I2cError) -> Steps:
        until_ps = give_up_ps if injection.end_ps is None else injection.end_ps
        yield self._env.timeout(min(until_ps, give_up_ps) - self._env.now)
        if self._env.now >= give_up_ps:
            raise error

    def _nack(self, on: str) -> bool:
        for injection in self._acting():
            fault = injection.fault
            if isinstance(fault, I2cNack) and fault.on == on and injection.strikes(fault.rate):
                self._report(self._env.now, injection, f"{on} not acknowledged")
                return True
        return False


def _timeout(address: int) -> I2cError:
    return I2cError(errno.ETIMEDOUT, f"I2C device {address:#04x} held the clock low for over 1 s")
