"""The com port control option of telnet, server side: RFC 2217, section 3, from one table.

pyserial's ``PortManager`` splits the stream and negotiates options; all commands are here. Each
command with a value is acknowledged with the value that is in effect, also if it is not the
requested one. Flow control, DTR and RTS are stored and returned, without effect: the line has none.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from serial.rfc2217 import COM_PORT_OPTION, PortManager

from cubestack.emulator.bus.line_format import LineFormat, Parity

ACKNOWLEDGED = 100
"""The server's number of a command is the client's plus this."""

SIGNATURE_TEXT = b"cubestack"

SIGNATURE, SET_BAUDRATE, SET_DATASIZE, SET_PARITY, SET_STOPSIZE, SET_CONTROL = range(6)
NOTIFY_LINESTATE, NOTIFY_MODEMSTATE, FLOWCONTROL_SUSPEND, FLOWCONTROL_RESUME = range(6, 10)
SET_LINESTATE_MASK, SET_MODEMSTATE_MASK, PURGE_DATA = range(10, 13)

OVERRUN, PARITY_ERROR, FRAMING_ERROR, BREAK = 2, 4, 8, 16
DATA_READY, HOLDING_EMPTY, SHIFT_EMPTY = 1, 32, 64
"""Bits of NOTIFY-LINESTATE."""

CTS, DSR, RING, CARRIER = 16, 32, 64, 128
"""Bits of NOTIFY-MODEMSTATE; the same shifted by four to the right: it has changed."""

SLOWEST_BAUD = 50
"""The lowest rate of termios(3): one character takes 0.2 s, and so long the next client waits."""

PARITIES: dict[int, Parity] = {1: "N", 2: "O", 3: "E", 4: "M", 5: "S"}
STOP_BITS: dict[int, float] = {1: 1, 2: 2, 3: 1.5}


@dataclass(frozen=True)
class Control:
    """A setting of SET-CONTROL."""

    query: int  # value that requests the setting
    values: tuple[int, ...]  # values that change it; the first one is the default
    meaning: str


CONTROLS = (
    Control(0, (1, 2, 3, 17, 19), "flow control, both directions or outbound"),
    Control(4, (6, 5), "break"),
    Control(7, (9, 8), "DTR"),
    Control(10, (12, 11), "RTS"),
    Control(13, (14, 15, 16, 18), "flow control, inbound"),
)
BREAK_ON = 5
INBOUND = {1: 14, 2: 15, 3: 16}
"""Inbound flow control after a command for both directions."""


@dataclass(frozen=True)
class Command:
    """A command of a client."""

    name: str  # as in the RFC
    length: int | None  # of the value, in bytes; None: any
    handle: Callable[["ComPort", bytes], bytes | None]  # returns the acknowledged value, or None
    meaning: str  # of the acknowledged value, for the documentation


class ComPort(PortManager):  # type: ignore[misc]  # pyserial has no types
    """One client's option.

    Attributes:
        line_mask: bits of the line state that the client wants to hear of.
        modem_mask: bits of the modem state.
        suspended: whether the client wants no data and no acknowledgements for now.
    """

    def __init__(
        self, port: "Settings", write: Callable[[bytes], object], flush: Callable[[], object]
    ) -> None:
        """``write`` receives the bytes to send, ``flush`` sends those that wait."""
        self.port, self._flush = port, flush
        self.line_mask, self.modem_mask = 0, 0xFF
        self.suspended = False
        self._modem: int | None = None
        self._controls = {control.query: control.values[0] for control in CONTROLS}
        super().__init__(port, _Connection(write))

    def check_modem_lines(self, force_notification: bool = False) -> None:
        """Notify the client of the modem lines if they changed, or if forced."""
        state = CTS | DSR | CARRIER if self.port.plugged else 0
        changed = 0 if self._modem is None else state ^ self._modem
        self._modem = state
        told = (state | changed >> 4) & self.modem_mask
        if force_notification or (changed and told):
            self._send(NOTIFY_MODEMSTATE, bytes([told]))

    def notify_line(self, events: int) -> None:
        """Notify the client of ``events``, bits of the line state, as far as it wants to."""
        if events & self.line_mask:
            self._send(NOTIFY_LINESTATE, bytes([events & self.line_mask]))

    def _send(self, command: int, value: bytes) -> None:
        self.rfc2217_send_subnegotiation(bytes([command + ACKNOWLEDGED]), value)

    def _telnet_process_subnegotiation(self, suboption: bytes) -> None:
        if suboption[:1] != COM_PORT_OPTION or len(suboption) < 2:
            return
        number, value = suboption[1], suboption[2:]
        command = COMMANDS.get(number)
        if command is None:
            return
        if command.length not in (None, len(value)):
            raise ValueError(f"{command.name} has {command.length} bytes, not {len(value)}")
        answer = command.handle(self, value)
        if answer is not None:
            self._send(number, answer)
        if number == SET_MODEMSTATE_MASK:
            self.check_modem_lines(force_notification=bool(value[0]))

    # --- one per command ------------------------------------------------------------------------

    def _signature(self, _value: bytes) -> bytes:
        return SIGNATURE_TEXT

    def _baud_rate(self, value: bytes) -> bytes:
        baud = int.from_bytes(value, "big")
        self._change(baud=baud if baud >= SLOWEST_BAUD else None)
        return self.port.form.baud.to_bytes(4, "big")

    def _data_size(self, value: bytes) -> bytes:
        self._change(data_bits=value[0] or None)
        return bytes([self.port.form.data_bits])

    def _parity(self, value: bytes) -> bytes:
        self._change(parity=PARITIES.get(value[0]))
        return bytes([_key(PARITIES, self.port.form.parity)])

    def _stop_size(self, value: bytes) -> bytes:
        self._change(stop_bits=STOP_BITS.get(value[0]))
        return bytes([_key(STOP_BITS, self.port.form.stop_bits)])

    def _change(self, **setting: Any) -> None:
        """Change one field of the format; None and impossible values change nothing."""
        if None in setting.values():
            return
        try:
            form = LineFormat(**(vars(self.port.form) | setting))
        except ValueError:
            return
        self.port.change(form)

    def _control(self, value: bytes) -> bytes | None:
        wanted = value[0]
        for control in CONTROLS:
            if wanted in control.values:
                self._controls[control.query] = wanted
                if wanted in INBOUND:
                    self._controls[CONTROLS[-1].query] = INBOUND[wanted]
                if wanted == BREAK_ON:
                    self.port.send_break()
            if wanted == control.query or wanted in control.values:
                return bytes([self._controls[control.query]])
        return None

    def _line_state(self, _value: bytes) -> bytes:
        return bytes([self.port.line_state() & 0xFF])

    def _modem_state(self, _value: bytes) -> None:
        self.check_modem_lines(force_notification=True)

    def _suspend(self, _value: bytes) -> None:
        self._send(FLOWCONTROL_SUSPEND, b"")
        self._flush()  # the last bytes for now
        self.suspended = True

    def _resume(self, _value: bytes) -> bytes:
        self.suspended = False
        return b""

    def _set_line_mask(self, value: bytes) -> bytes:
        self.line_mask = value[0]
        return value

    def _set_modem_mask(self, value: bytes) -> bytes:
        self.modem_mask = value[0]
        return value

    def _purge(self, value: bytes) -> bytes:
        if value[0] in (1, 3):
            self.port.drop_received()
        if value[0] in (2, 3):
            self.port.drop_written()
        return value


COMMANDS = {
    SIGNATURE: Command("SIGNATURE", None, ComPort._signature, "the server's name"),
    SET_BAUDRATE: Command("SET-BAUDRATE", 4, ComPort._baud_rate, "baud rate; 0 requests it"),
    SET_DATASIZE: Command("SET-DATASIZE", 1, ComPort._data_size, "data bits; 0 requests them"),
    SET_PARITY: Command("SET-PARITY", 1, ComPort._parity, "parity; 0 requests it"),
    SET_STOPSIZE: Command("SET-STOPSIZE", 1, ComPort._stop_size, "stop bits; 0 requests them"),
    SET_CONTROL: Command(
        "SET-CONTROL",
        1,
        ComPort._control,
        "the setting in effect: flow control, break, DTR or RTS; 0, 4, 7, 10 and 13 request it",
    ),
    NOTIFY_LINESTATE: Command(
        "NOTIFY-LINESTATE", None, ComPort._line_state, "the present state of the line"
    ),
    NOTIFY_MODEMSTATE: Command(
        "NOTIFY-MODEMSTATE", None, ComPort._modem_state, "the present state of the modem lines"
    ),
    FLOWCONTROL_SUSPEND: Command(
        "FLOWCONTROL-SUSPEND",
        0,
        ComPort._suspend,
        "no value; it is the last until the client resumes",
    ),
    FLOWCONTROL_RESUME: Command("FLOWCONTROL-RESUME", 0, ComPort._resume, "no value"),
    SET_LINESTATE_MASK: Command("SET-LINESTATE-MASK", 1, ComPort._set_line_mask, "the mask"),
    SET_MODEMSTATE_MASK: Command(
        "SET-MODEMSTATE-MASK", 1, ComPort._set_modem_mask, "the mask, then the modem lines"
    ),
    PURGE_DATA: Command("PURGE-DATA", 1, ComPort._purge, "1 received, 2 unsent bytes, 3 both"),
}
"""By number. An unknown one is ignored; a value of another length ends the connection."""


@dataclass
class Settings:
    """The line, as the option changes and reads it."""

    form_of: Callable[[], LineFormat]
    change: Callable[[LineFormat], None]
    drop_received: Callable[[], None]
    drop_written: Callable[[], None]
    send_break: Callable[[], None]
    line_state: Callable[[], int]
    plugged_in: Callable[[], bool]

    @property
    def form(self) -> LineFormat:
        return self.form_of()

    @property
    def plugged(self) -> bool:
        return self.plugged_in()


class _Connection:
    def __init__(self, write: Callable[[bytes], object]) -> None:
        self.write = write


def _key(table: dict[int, Any], value: object) -> int:
    return next(number for number, meaning in table.items() if meaning == value)
