"""Replays the host of a recording to a board, and compares the device's answers.

The board must be configured and powered up like the recorded one. It receives the host's bytes at
the same virtual times, and the recorded commands from outside of its ports. The same byte at
another time counts as a difference. What follows the end of a recording that was cut off does not.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from itertools import zip_longest
from typing import Any

import simpy

from cubestack.emulator.bus.i2c import I2cBus, I2cError, I2cMessage
from cubestack.emulator.bus.uart import Uart, UartTap
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.formats import recording as rec
from cubestack.firmware_model.formats.byte_names import name_answer_byte, name_bus_byte
from cubestack.firmware_model.interface.codec.message import Interface

SETTLE_PS = PS_PER_S
"""A replay continues for this time after the last event, to detect additional bytes."""


class Replay:
    """Replays a recording's host to a board that has just been powered up."""

    def __init__(
        self,
        recording: rec.Recording,
        kernel: Kernel,
        uarts: Mapping[str, Uart],
        bus: I2cBus,
        act: Callable[[rec.Control], None] | None = None,
    ) -> None:
        """Prepare; ``act`` performs the recorded commands from outside of the ports.

        Raises ValueError for a recording with ports that the board lacks, or with such commands
        but no ``act``.
        """
        if recording.controls and act is None:
            words = " ".join(recording.controls[0].words)
            raise ValueError(f"{recording.name}: command {words!r} is not supported here")
        missing = set(recording.bauds) - set(uarts)
        if missing:
            raise ValueError(
                f"{recording.name} has port {', '.join(sorted(missing))}, "
                f"this device has {', '.join(uarts)}"
            )
        self._recording = recording
        self._kernel = kernel
        self._listeners = {port: _Listener(uart) for port, uart in uarts.items()}
        self._bus_transfers: list[rec.BusTransfer] = []
        self._stopped = False
        for port, uart in uarts.items():
            kernel.process(self._write(port, uart))
        kernel.process(self._transfer(bus))
        if act is not None:
            kernel.process(self._act(act))

    def run(self, interface: Interface) -> list[str]:
        """Replay to the end.

        Returns one line for each port on which the device's answers differ; it names the first
        byte that differs and its field.
        """
        self._kernel.advance_to(self._recording.end_ps + SETTLE_PS)
        lines = [self._compare_line(interface, *item) for item in self._listeners.items()]
        return [text for text in (*lines, self._compare_bus(interface)) if text is not None]

    def stop(self) -> None:
        """Send nothing more; bytes on a wire still arrive."""
        self._stopped = True

    def _wait_until(self, time_ps: int) -> Generator[simpy.Event, Any, bool]:
        yield self._kernel.timeout(max(0, time_ps - self._kernel.now))
        return not self._stopped

    def _write(self, port: str, uart: Uart) -> Generator[simpy.Event, Any, None]:
        for event in self._recording.events:
            if not isinstance(event, rec.LineBytes | rec.LineError) or event.port != port:
                continue
            if isinstance(event, rec.LineBytes) and event.side == "device":
                continue
            if not (yield from self._wait_until(event.time_ps)):
                return
            if isinstance(event, rec.LineBytes):
                uart.host_writes(event.data)
            else:
                uart.host_breaks()

    def _act(self, act: Callable[[rec.Control], None]) -> Generator[simpy.Event, Any, None]:
        for control in self._recording.controls:
            if not (yield from self._wait_until(control.time_ps)):
                return
            act(control)

    def _transfer(self, bus: I2cBus) -> Generator[simpy.Event, Any, None]:
        for transfer in self._recording.transfers:
            if not (yield from self._wait_until(transfer.time_ps)):
                return
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
            found = tuple(rec.BusMessage(m.address, bytes(m.data), m.reading) for m in messages)
            begun, now_ps = (transfer.time_ps, transfer.port), self._kernel.now
            self._bus_transfers.append(rec.BusTransfer(*begun, now_ps, found, errno))

    def _compare_line(self, interface: Interface, port: str, heard: "_Listener") -> str | None:
        expected, times = self._recording.sent(port, "device")
        end = None if self._recording.whole else len(expected)
        found, found_times = heard.data[:end], heard.times[:end]
        if (index := _first_difference(expected, found)) is not None:
            what = _bytes(expected, found, index)
        elif (index := _first_difference(times, found_times)) is not None:
            what = f"same bytes, {(found_times[index] - times[index]) / 1e6:+.3f} us in time"
        else:
            return None
        return f"{name_answer_byte(interface, self._recording, port, index)}: {what}"

    def _compare_bus(self, interface: Interface) -> str | None:
        for then, now in zip(self._recording.transfers, self._bus_transfers, strict=False):
            for number, (before, after) in enumerate(zip(then.messages, now.messages, strict=True)):
                index = _first_difference(before.data, after.data)
                if index is not None:
                    name = name_bus_byte(interface, then, number, index)
                    return f"{name}: {_bytes(before.data, after.data, index)}"
            if then.errno != now.errno:
                errnos = f"errno {now.errno}, recorded {then.errno}"
                return f"{then.port}: transfer at {then.time_ps} ps: {errnos}"
        return None


class _Listener(UartTap):
    """Stores what the device sends on a line."""

    def __init__(self, uart: Uart) -> None:
        self.data = bytearray()
        self.times: list[int] = []
        uart.taps.append(self)

    def device_sent(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        self.data += data
        self.times += [first_ps + (index - 1) * byte_ps for index in range(len(data))]


def _first_difference(expected: Sequence[int], found: Sequence[int]) -> int | None:
    pairs = enumerate(zip_longest(expected, found))
    return next((index for index, (one, other) in pairs if one != other), None)


def _bytes(expected: Sequence[int], found: Sequence[int], index: int) -> str:
    def show(data: Sequence[int]) -> str:
        return f"{data[index]:#04x}" if index < len(data) else "nothing"

    return f"{show(found)}, recorded {show(expected)}"
