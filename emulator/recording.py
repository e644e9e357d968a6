"""Records what goes over a board's serial lines and I2C bus, and plays it back to a board.

Every byte with its side, port and virtual time; the format is that of
``firmware_model.interface.recording``. A replay sends the host's part at the same virtual times to
a board that was powered up like the recorded one, and compares what the device says.
"""

from collections.abc import Generator, Mapping
from itertools import zip_longest
from types import TracebackType
from typing import IO, Any, Self

import simpy

from cubestack.emulator.bus_tap import BusTap
from cubestack.emulator.i2c import I2cBus, I2cMessage, I2cNackError
from cubestack.emulator.uart import Uart
from cubestack.emulator.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.interface.message import Interface
from cubestack.firmware_model.interface.recording import (
    BusMessage,
    BusTransfer,
    LineBytes,
    LineError,
    Recording,
    RecordingWriter,
    Side,
)
from cubestack.firmware_model.interface.transcript import name_answer_byte, name_bus_byte

__all__ = ["RecordedBus", "Recorder", "Replay"]

BLOCK_BYTES = 256
"""Longest run of bytes in one event."""

SETTLE_PS = PS_PER_S
"""How long a replay goes on after the last event: what comes late is different, too."""


class Recorder:
    """Writes a recording; attach it before anything is said."""

    def __init__(self, stream: IO[str], device: str, uarts: Mapping[str, Uart]) -> None:
        """Record ``uarts`` by the names of their ports; ``stream`` stays its owner's."""
        bauds = {port: uart.form.baud for port, uart in uarts.items()}
        self._writer = RecordingWriter(stream, device, bauds)
        self._taps = [_Tap(self._writer, port, uart) for port, uart in uarts.items()]

    def bus(self, kernel: Kernel, bus: I2cBus, port: str = "i2c") -> "RecordedBus":
        """``bus``, with its transfers on record; to be used in its place."""
        return RecordedBus(kernel, bus, port, self._writer)

    def close(self) -> None:
        """Write what is pending and detach."""
        for tap in self._taps:
            tap.close()

    def __enter__(self) -> Self:
        """Use the recorder in a ``with`` block."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()


class _Tap:
    """Joins bytes that follow each other without a gap."""

    def __init__(self, writer: RecordingWriter, port: str, uart: Uart) -> None:
        self._writer = writer
        self._port = port
        self._uart = uart
        self._side: Side = "host"
        self._data = bytearray()
        self._start_ps = 0
        uart.taps.append(self)

    def device_sent(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        self._add("device", data, first_ps - byte_ps)

    def device_heard(self, byte: int, start_ps: int) -> None:
        self._add("host", bytes([byte]), start_ps)

    def framing_error(self, time_ps: int) -> None:
        self._flush()
        self._writer.write(LineError(time_ps, self._port))

    def close(self) -> None:
        self._flush()
        self._uart.taps.remove(self)

    def _add(self, side: Side, data: bytes, start_ps: int) -> None:
        next_ps = self._start_ps + len(self._data) * self._uart.byte_ps
        if side != self._side or start_ps != next_ps or len(self._data) >= BLOCK_BYTES:
            self._flush()
        if not self._data:
            self._side, self._start_ps = side, start_ps
        self._data += data

    def _flush(self) -> None:
        if self._data:
            event = LineBytes(
                self._start_ps, self._port, self._side, bytes(self._data), self._uart.byte_ps
            )
            self._writer.write(event)
            self._data.clear()


class RecordedBus(BusTap):
    """An I2C bus with its transfers on record."""

    def __init__(self, kernel: Kernel, bus: I2cBus, port: str, writer: RecordingWriter) -> None:
        """Stand in for ``bus``."""
        self._kernel = kernel
        super().__init__(bus)
        self._port = port
        self._writer = writer

    def transfer(self, messages: list[I2cMessage]) -> Generator[simpy.Event, Any, None]:
        """See I2cBus."""
        start_ps, errno = self._kernel.now, 0
        try:
            yield from self._bus.transfer(messages)
        except I2cNackError as error:
            errno = error.errno or 0
            raise
        finally:
            found = tuple(BusMessage(m.address, bytes(m.data), m.reading) for m in messages)
            event = BusTransfer(start_ps, self._port, self._kernel.now, found, errno)
            self._writer.write(event)


class Replay:
    """Plays a recording's host to a board that has just been powered up.

    Attributes:
        differences: one line for each port where the device says something else, the first byte
            that differs and its field named; complete after ``run``.
    """

    def __init__(
        self, recording: Recording, kernel: Kernel, uarts: Mapping[str, Uart], bus: I2cBus
    ) -> None:
        """Prepare; raises ValueError for a recording with ports that the board lacks."""
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

    def run(self, interface: Interface) -> list[str]:
        """Play to the end; returns ``differences``."""
        self._kernel.advance_to(self._recording.end_ps + SETTLE_PS)
        for port, listener in self._heard.items():
            self._compare_line(interface, port, listener)
        self._compare_bus(interface)
        return self.differences

    def _write(self, port: str, uart: Uart) -> Generator[simpy.Event, Any, None]:
        for block in self._recording.line(port):
            if block.side == "host":
                yield self._kernel.timeout(max(0, block.time_ps - self._kernel.now))
                uart.host_writes(block.data)

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
            except I2cNackError as error:
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
