"""A serial port on TCP whose client chooses baud rate and format: RFC 2217.

The device's end keeps its format. If a client chooses another one, bytes are garbled in both
directions, as on a real line (``emulator.bus.line_format``). The client receives bytes with errors
as decoded, like those of Linux's serial drivers, and notifications of the states of line and modem
that it requested. The default format is the device's. ``com_port`` has the commands.
"""

import select

from serial.rfc2217 import IAC, IAC_DOUBLED

from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports import com_port
from cubestack.emulator.ports.com_port import ComPort
from cubestack.emulator.ports.tcp import TcpEndpoint

CHUNK_BYTES = 4096
"""Bytes per write to the socket; a client with more unsent replies is not read."""

MAX_SUBOPTION = 512
"""Limit of the bytes between IAC SB and IAC SE; RFC 2217 needs a little over 255."""


class Rfc2217Endpoint(TcpEndpoint):
    """As ``TcpEndpoint``; a client that violates the protocol is disconnected."""

    scheme = "rfc2217"

    def __init__(self, host: str, port: int, uart: Uart, *, allow_remote: bool = False) -> None:
        """Listen on ``host``:``port``; arguments and errors as for :class:`TcpEndpoint`."""
        self._device_form = uart.form
        self._written = bytearray()
        self._replies = bytearray()
        self._manager: ComPort | None = None
        self._idle = True
        self._overruns = 0
        self._arrived = False
        self._now_ps = 0
        super().__init__(host, port, uart, allow_remote=allow_remote)

    def exchange(self, now_ps: int) -> None:
        """Also notifies the client of states of the line, and sends pending replies."""
        self._now_ps = now_ps
        errors = self._line.framing_errors, self._line.parity_errors, self._line.breaks
        super().exchange(now_ps)
        if self._manager is not None:
            self._notify(*errors)
            self._flush()

    def pull(self) -> None:
        super().pull()
        self._check_modem_lines()

    def plug(self, uart: Uart) -> None:
        super().plug(uart)
        self._check_modem_lines()

    def _check_modem_lines(self) -> None:
        if self._manager is not None:
            self._manager.check_modem_lines()
            self._flush()

    def _welcome(self) -> None:
        if self._line.form != self._device_form:
            self._line.uart.host_drops()  # at the rate of a client before, it may take hours
        self._line.form = self._device_form
        settings = com_port.Settings(
            form_of=lambda: self._line.form,
            change=self._change_form,
            drop_received=self._purge,
            drop_written=self._drop_writes,
            send_break=lambda: self._line.uart.host_breaks(),
            line_state=self._line_state,
            plugged_in=lambda: self._plugged,
        )
        self._manager = ComPort(settings, self._replies.extend, self._flush)

    def _read(self, max_bytes: int) -> bytes:
        manager = self._manager
        if manager is None or len(self._replies) > CHUNK_BYTES:
            return b""
        try:
            for byte in manager.filter(super()._read(max_bytes)):
                self._written += byte
            if len(manager.suboption or b"") <= MAX_SUBOPTION:
                return self._take_written()
        except (TypeError, ValueError):  # the former by pyserial, for a misplaced SE
            pass
        self._drop()
        return b""

    def _write(self, data: bytearray) -> int:
        self._flush()
        if self._replies or self._manager is None or self._manager.suspended:
            return 0
        self._arrived = True
        count = min(len(data), CHUNK_BYTES)
        self._replies += data[:count].replace(IAC, IAC_DOUBLED)
        self._flush()
        return count

    def _flush(self) -> None:
        suspended = self._manager is not None and self._manager.suspended
        if self._replies and self._client is not None and not suspended:
            sent = super()._write(self._replies)
            del self._replies[:sent]

    def _events(self, *, reading: bool) -> int:
        events = super()._events(reading=reading and len(self._replies) <= CHUNK_BYTES)
        if self._manager is not None and self._manager.suspended:
            return events & ~select.POLLOUT
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

    def _line_state(self) -> int:
        state = com_port.DATA_READY if self._unread else 0
        if not self._line.uart.host_backlog:
            state |= com_port.HOLDING_EMPTY | com_port.SHIFT_EMPTY
        return state

    def _notify(self, framing_before: int, parity_before: int, breaks_before: int) -> None:
        """Notify the client of errors since the last exchange, and of a line that became idle."""
        assert self._manager is not None
        state = com_port.DATA_READY if self._arrived else 0
        if self._line.framing_errors > framing_before:
            state |= com_port.FRAMING_ERROR
        if self._line.parity_errors > parity_before:
            state |= com_port.PARITY_ERROR
        if self._line.breaks > breaks_before:
            state |= com_port.BREAK
        if self.overruns > self._overruns:
            state |= com_port.OVERRUN
        idle = not self._line.uart.host_backlog
        if idle and not self._idle:
            state |= com_port.HOLDING_EMPTY | com_port.SHIFT_EMPTY
        self._idle, self._overruns, self._arrived = idle, self.overruns, False
        self._manager.notify_line(state)
