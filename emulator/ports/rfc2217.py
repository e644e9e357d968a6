"""A serial port on TCP whose client chooses baud rate and format: RFC 2217, through pyserial.

The device's end keeps its format. A client that chooses another one hears garbage and is not
understood, as on a real line (``emulator.bus.line_format``). Bytes with errors reach the client
as they were received, as Linux's serial drivers hand them on; who asks for line states is told of
them. A client that says nothing of a format has the device's. Accepted without effect: flow
control and modem lines, as the line has neither.
"""

import select
import struct
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from serial.rfc2217 import IAC, IAC_DOUBLED, SERVER_NOTIFY_LINESTATE, PortManager

from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.line import HostLine
from cubestack.emulator.ports.tcp import TcpEndpoint

CHUNK_BYTES = 4096
"""Bytes handed to the socket at once, and of unsent replies before a client is not read from."""

MAX_SUBOPTION = 512
"""Bytes between IAC SB and IAC SE; RFC 2217 needs 255 and some."""

FRAMING_ERROR, PARITY_ERROR = 8, 4
"""Bits of NOTIFY-LINESTATE, RFC 2217 section 3."""


class Rfc2217Endpoint(TcpEndpoint):
    """One client at a time, as ``TcpEndpoint``; one that breaks the protocol is dropped."""

    scheme = "rfc2217"

    def __init__(self, host: str, port: int, uart: Uart, *, allow_remote: bool = False) -> None:
        """Listen on ``host``:``port``, as :class:`TcpEndpoint` does; same errors."""
        self._device_form = uart.form
        self._written = bytearray()
        self._replies = bytearray()
        self._manager: Any = None
        self._now_ps = 0
        super().__init__(host, port, uart, allow_remote=allow_remote)

    def exchange(self, now_ps: int) -> None:
        """Also tells a client that asked for it of errors on the line, and sends what was left."""
        self._now_ps = now_ps
        errors = self._line.framing_errors, self._line.parity_errors
        super().exchange(now_ps)
        if self._manager is not None:
            self._notify_errors(*errors)
            self._flush()

    def _welcome(self) -> None:
        self._line.form = self._device_form
        settings = _Settings(self._line, self._change_form, self._purge, self._drop_writes)
        self._manager = PortManager(settings, SimpleNamespace(write=self._replies.extend))

    def _read(self, max_bytes: int) -> bytes:
        manager = self._manager
        if manager is None or len(self._replies) > CHUNK_BYTES:
            return b""
        try:
            for byte in manager.filter(super()._read(max_bytes)):
                self._written += byte
            if len(manager.suboption or b"") <= MAX_SUBOPTION:
                return self._take_written()
        # What pyserial raises for options that are cut short, unknown or out of place.
        except (struct.error, KeyError, TypeError, ValueError):
            pass
        self._drop()
        return b""

    def _write(self, data: bytearray) -> int:
        self._flush()
        if self._replies or self._manager is None:
            return 0
        count = min(len(data), CHUNK_BYTES)
        self._replies += data[:count].replace(IAC, IAC_DOUBLED)
        self._flush()
        return count

    def _flush(self) -> None:
        if self._replies and self._client is not None:
            sent = super()._write(self._replies)
            del self._replies[:sent]

    def _events(self, *, reading: bool) -> int:
        events = super()._events(reading=reading and len(self._replies) <= CHUNK_BYTES)
        return events | (select.POLLOUT if self._replies else 0)

    def _drop(self) -> None:
        super()._drop()
        self._manager = None
        self._replies.clear()
        self._written.clear()

    def _take_written(self) -> bytes:
        data = bytes(self._written)
        self._written.clear()
        return data

    def _change_form(self, form: LineFormat) -> None:
        """What was written before keeps the form that it had then."""
        self._line.uart.host_writes(self._take_written())
        self._line.form = form

    def _drop_writes(self) -> None:
        self._written.clear()
        self._line.uart.host_drops()

    def _purge(self) -> None:
        self._unread.clear()
        self._line.take(self._now_ps)

    def _notify_errors(self, framing_before: int, parity_before: int) -> None:
        state = FRAMING_ERROR if self._line.framing_errors > framing_before else 0
        state |= PARITY_ERROR if self._line.parity_errors > parity_before else 0
        if state & self._manager.linstate_mask:
            self._manager.rfc2217_send_subnegotiation(SERVER_NOTIFY_LINESTATE, bytes([state]))


def _setting(name: str) -> property:
    """A field of the line's format; one that can not be raises ValueError, the old one stays."""

    def change(settings: "_Settings", value: object) -> None:
        settings.change(LineFormat(**(vars(settings.line.form) | {name: value})))

    return property(lambda settings: getattr(settings.line.form, name), change)


@dataclass
class _Settings:
    """The line's end, as PortManager wants a port: named like pyserial's Serial."""

    line: HostLine
    change: Callable[[LineFormat], None]
    reset_input_buffer: Callable[[], None]
    reset_output_buffer: Callable[[], None]
    cts = dsr = cd = True
    ri = rts = dtr = xonxoff = rtscts = False
    baudrate, bytesize = _setting("baud"), _setting("data_bits")
    parity, stopbits = _setting("parity"), _setting("stop_bits")

    @property
    def break_condition(self) -> bool:
        return False

    @break_condition.setter
    def break_condition(self, on: bool) -> None:
        if on:
            self.line.uart.host_breaks()
