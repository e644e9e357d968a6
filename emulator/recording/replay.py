"""Plays the host of a recording to a board, and compares what the device says.

The board was powered up like the recorded one. It gets the host's part at the same virtual times,
and what was done to it from outside of its ports; a same byte at another time is a difference.
"""

from collections.abc import Callable, Generator, Mapping
from itertools import zip_longest
from typing import Any

import simpy

from cubestack.emulator.bus.i2c import I2cBus, I2cError, I2cMessage
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.formats.byte_names import name_answer_byte, name_bus_byte
from cubestack.firmware_model.formats.recording import (
    BusMessage,
    BusTransfer,
    Control,
    LineBytes,
    LineError,
    Recording,
)
from cubestack.firmware_model.interface.codec.message import Interface

SETTLE_PS = PS_PER_S
"""How long a replay goes on after the last event: what comes late is different, too."""


class Replay:
    """Plays a recording's host to a board that has just been powered up.

    Attributes:
        differences: one line for each port where the device says something else, the first byte
            that differs and its field named; complete after ``run``.
    """

    def __init__(
        self,
        recording: Recording,
        kernel: Kernel,
        uarts: Mapping[str, Uart],
        bus: I2cBus,
        act: Callable[[Control], None] | None = None,
    ) -> None:
        """Prepare; ``act`` does to the board what was done from outside of its ports.

        Raises ValueError for a recording with ports that the board lacks, or with such acts when
        nobody does them.
        """
        if recording.controls and act is None:
            raise ValueError(
                f"{recording.name}: {' '.join(recording.controls[0].words)} can not be done here"
            )
        missing = set(recording.bauds) - set(uarts)
        if missing:
            raise ValueError(
                f"{recording.name} has port {', '.join(sorted(missing))}, "
                f"this device has {', '.join(uarts)}"
            )
        self._recording = recording
        self._kernel = kernel
        self._heard: dict[str, _Listener] = {}
        self._bus_found: list[BusTransfer] = []
        self.differences: list[str] = []
        for port, uart in uarts.items():
            self._heard[port] = _Listener(uart)
            kernel.process(self._write(port, uart))
        kernel.process(self._transfer(bus))
        if act is not None:
            kernel.process(self._act(act))

    def run(self, interface: Interface) -> list[str]:
        """Play to the end; returns ``differences``."""
        self._kernel.advance_to(self._recording.end_ps + SETTLE_PS)
        for port, listener in self._heard.items():
            self._compare_line(interface, port, listener)
        self._compare_bus(interface)
        return self.differences

    def _write(self, port: str, uart: Uart) -> Generator[simpy.Event, Any, None]:
        for event in self._recording.events:
            if not isinstance(event, LineBytes | LineError) or event.port != port:
                continue
            if isinstance(event, LineBytes) and event.side == "device":
                continue
            yield self._kernel.timeout(max(0, event.time_ps - self._kernel.now))
            if isinstance(event, LineBytes):
                uart.host_writes(event.data)
            else:
                uart.host_breaks()

    def _act(self, act: Callable[[Control], None]) -> Generator[simpy.Event, Any, None]:
        for control in self._recording.controls:
            yield self._kernel.timeout(max(0, control.time_ps - self._kernel.now))
            act(control)

    def _transfer(self, bus: I2cBus) -> Generator[simpy.Event, Any, None]:
        for transfer in self._recording.transfers:
            yield self._kernel.timeout(max(0, transfer.time_ps - self._kernel.now))
            messages = [
                I2cMessage(m.address, read=len(m.data), probe_read=not m.data)
                if m.read
                else I2cMessage(m.address, bytearray(m.data))
                for m in transfer.messages
            ]
            errno = 0
            try:
                yield from bus.transfer(messages)
            except I2cError as error:
                errno = error.errno or 0
            found = tuple(BusMessage(m.address, bytes(m.data), m.reading) for m in messages)
            now_ps = self._kernel.now
            self._bus_found.append(
                BusTransfer(transfer.time_ps, transfer.port, now_ps, found, errno)
            )

    def _compare_line(self, interface: Interface, port: str, listener: "_Listener") -> None:
        expected, times = self._recording.sent(port, "device")
        found = bytes(listener.data)
        index = _first_difference(expected, found)
        if index is not None:
            name = name_answer_byte(interface, self._recording, port, index)
            self.differences.append(f"{name}: {_bytes(expected, found, index)}")
            return
        for index, (then_ps, now_ps) in enumerate(zip(times, listener.times, strict=True)):
            if then_ps != now_ps:
                name = name_answer_byte(interface, self._recording, port, index)
                change_us = (now_ps - then_ps) / 1e6
                self.differences.append(f"{name}: same bytes, {change_us:+.3f} us in time")
                return

    def _compare_bus(self, interface: Interface) -> None:
        for then, now in zip(self._recording.transfers, self._bus_found, strict=False):
            for number, (before, after) in enumerate(zip(then.messages, now.messages, strict=True)):
                index = _first_difference(before.data, after.data)
                if index is not None:
                    name = name_bus_byte(interface, then, number, index)
                    what = _bytes(before.data, after.data, index)
                    self.differences.append(f"{name}: {what}")
                    return
            if then.errno != now.errno:
                self.differences.append(
                    f"{then.port}: transfer at {then.time_ps} ps: errno {now.errno}, "
                    f"recorded {then.errno}"
                )
                return


class _Listener:
    """Keeps what the device sends on a line."""

    def __init__(self, uart: Uart) -> None:
        self.data = bytearray()
        self.times: list[int] = []
        uart.taps.append(self)

    def device_sent(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        self.data += data
        self.times += [first_ps + (index - 1) * byte_ps for index in range(len(data))]

    def device_heard(self, byte: int, start_ps: int) -> None:
        """The replay said so itself."""

    def framing_error(self, time_ps: int) -> None:
        """Not a byte from the device."""


def _first_difference(expected: bytes, found: bytes) -> int | None:
    for index, (one, other) in enumerate(zip_longest(expected, found)):
        if one != other:
            return index
    return None


def _bytes(expected: bytes, found: bytes, index: int) -> str:
    def show(data: bytes) -> str:
        return f"{data[index]:#04x}" if index < len(data) else "nothing"

    return f"{show(found)}, recorded {show(expected)}"
