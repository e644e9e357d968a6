"""Diagnoses what is on a serial line: which node, or why none answers."""

import os
from collections.abc import Iterator

from cubestack.firmware_model.interface.codec.field import InterfaceError
from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.codec.node_messages import IDENTIFICATION
from cubestack.host.transport.streams import (
    SerialTransport,
    TcpTransport,
    Transport,
    port_of,
    read_answer,
)

BAUDS = (57600, 115200, 9600, 19200, 38400, 230400, 460800, 921600, 4800, 2400)
"""Usual baud rates, most likely first."""

SILENCE_S = 0.3
"""Silence in s of wall time that ends an answer."""

MOST_BYTES = 512
MAX_READS = 100

CONFIRMATIONS = 2
"""Number of times that an answer at another rate, and silence at this one, must repeat."""


def node_type_of(interface: Interface) -> int:
    """Node type that the device of ``interface`` reports; 0 if its tables have none."""
    if interface.node_type:
        return interface.node_type
    try:
        return int(interface.telemetry(IDENTIFICATION.name).reset_values()["NodeType"])
    except (InterfaceError, KeyError):
        return 0


def identity_on(line: Transport) -> tuple[int, int] | None:
    """Type and interface version of the node on a line; None if it does not identify itself.

    The request has no side effects. Raises TransportError.
    """
    read_answer(line, 1 << 20, 0.0)  # drop earlier bytes
    line.write(encode_frame(bytes([IDENTIFICATION.id])))
    decoder = FrameDecoder(MOST_BYTES)
    for _ in range(MAX_READS):
        data = line.read(MOST_BYTES, SILENCE_S)
        if not data:
            break
        for byte in data:
            if decoder.feed(byte) is FrameEvent.FRAME:
                whole = len(decoder.payload) == IDENTIFICATION.length
                return (decoder.payload[0], decoder.payload[1]) if whole else None
    return None


def why_silent(line: Transport, interface: Interface) -> str:
    """The likely reason why ``interface``'s node does not answer on a line.

    It requests telemetry without side effects at the line's baud rate and others, then restores it.
    An answer that comes now and then is no matter of the rate. Returns an empty text if the node
    answers, and for recordings and emulations in this process. Raises TransportError.
    """
    port = port_of(line)
    if not isinstance(port, SerialTransport | TcpTransport):
        return ""
    heard = _ask(line, interface)
    if _answers(heard, interface):
        return ""
    if isinstance(port, SerialTransport):
        reason = _at_another_rate(line, port, interface) or _likely(heard, interface)
        users = "" if "baud" in reason else ", ".join(_other_users(port.name))
        return f"{reason}; {users} uses {port.name} too" if users else reason
    return _likely(heard, interface)


def _at_another_rate(line: Transport, port: SerialTransport, interface: Interface) -> str:
    own = port.baud

    def answers(baud: int) -> bool:
        return port.set_baud(baud) and _answers(_ask(line, interface), interface)

    try:
        for baud in (one for one in BAUDS if one != own):
            if answers(baud):
                for _ in range(CONFIRMATIONS):
                    if answers(own) or not answers(baud):
                        return "it answers now and then"
                return f"it answers at {baud} baud, and this is {own}"
    finally:
        port.set_baud(own)
    return ""


def _other_users(path: str) -> Iterator[str]:
    """This user's other processes that have ``path`` open, where /proc shows them."""
    real = os.path.realpath(path)
    try:
        numbers = [int(name) for name in os.listdir("/proc") if name.isdecimal()]
    except OSError:
        return
    for number in numbers:
        try:
            if number == os.getpid():
                continue
            opened = os.listdir(f"/proc/{number}/fd")
            if any(os.readlink(f"/proc/{number}/fd/{fd}") == real for fd in opened):
                with open(f"/proc/{number}/comm", encoding="utf-8", errors="replace") as name:
                    yield f"{name.read().strip()} (process {number})"
        except OSError:  # it has ended, or is another user's
            continue


def _likely(heard: bytes, interface: Interface) -> str:
    if not heard:
        return "no byte arrives: is it powered, is this its port, are RX and TX crossed?"
    if heard == _request(interface):
        return "only an echo comes back"
    payload = _payload(heard)
    shown = (heard if payload is None else payload)[:8].hex(" ")
    if payload is not None:
        return f"a node answers, but not as {interface.name} does: is it another device? ({shown})"
    return f"bytes arrive, but no frame: does it speak the node protocol at this rate? ({shown})"


def _request(interface: Interface) -> bytes:
    return encode_frame(bytes([interface.telemetries[0].id]))


def _ask(line: Transport, interface: Interface) -> bytes:
    read_answer(line, 1 << 20, 0.0)  # drop earlier bytes
    line.write(_request(interface))
    return read_answer(line, MOST_BYTES, SILENCE_S)


def _answers(heard: bytes, interface: Interface) -> bool:
    payload = _payload(heard)
    return payload is not None and len(payload) == interface.telemetries[0].length


def _payload(heard: bytes) -> bytes | None:
    """Payload of the first whole frame, or None."""
    decoder = FrameDecoder(MOST_BYTES)
    whole = (decoder.payload for byte in heard if decoder.feed(byte) is FrameEvent.FRAME)
    return next(whole, None)
