"""A serial port on TCP whose client chooses baud rate and format: RFC 2217, through pyserial.

The device's end keeps its format. If a client chooses another one, bytes are garbled in both
directions, as on a real line (``emulator.bus.line_format``). The client receives bytes with errors
as decoded, like those of Linux's serial drivers, and a notification if it requested line states.
The default format is the device's. Flow control and modem lines are accepted without effect, as the
line has neither.
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
"""Bytes per write to the socket; a client with more unsent replies is not read."""

MAX_SUBOPTION = 512
"""Limit of the bytes between IAC SB and IAC SE; RFC 2217 needs a little over 255."""

FRAMING_ERROR, PARITY_ERROR = 8, 4
"""Bits of NOTIFY-LINESTATE, RFC 2217 section 3."""


class Rfc2217Endpoint(TcpEndpoint):
    """As ``TcpEndpoint``; a client that violates the protocol is disconnected."""

    scheme = "rfc2217"

    def __init__(self, host: str, port: int, uart: Uart, *, allow_remote: bool = False) -> None:
        """Listen on ``host``:``port``; arguments and errors as for :class:`TcpEndpoint`."""
        self._device_form = uart.form
        self._written = bytearray()
        self._replies = bytearray()
        self._manager: Any = None
        self._now_ps = 0
        super().__init__(host, port, uart, allow_remote=allow_remote)

    def exchange(self, now_ps: int) -> None:
        """Also notifies the client of errors on the line, and sends pending replies."""
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
        # pyserial raises these for truncated, unknown or misplaced options.
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
        """Change the format; bytes written before are sent with the old one."""
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
    """A field of the line's format; an invalid value raises ValueError and changes nothing."""

    def change(settings: "_Settings", value: object) -> None:
        settings.change(LineFormat(**(vars(settings.line.form) | {name: value})))

    return property(lambda settings: getattr(settings.line.form, name), change)


@dataclass
class _Settings:
    """The line's end for PortManager, with the attribute names of pyserial's Serial."""

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
