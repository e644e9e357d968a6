"""Diagnoses a node that does not answer on a serial line, by requests at other baud rates."""

from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.interface.codec.message import Interface
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


def why_silent(line: Transport, interface: Interface) -> str:
    """The likely reason why ``interface``'s node does not answer on a line.

    It requests telemetry without side effects at the line's baud rate and others, then restores the
    rate. Returns an empty text if the node answers, and for recordings and emulations in this
    process. Raises TransportError.
    """
    port = port_of(line)
    if not isinstance(port, SerialTransport | TcpTransport):
        return ""
    heard = _ask(line, interface)
    if _answers(heard, interface):
        return ""
    if isinstance(port, SerialTransport):
        own = port.baud
        try:
            for baud in (one for one in BAUDS if one != own):
                if (
                    baud != own
                    and port.set_baud(baud)
                    and _answers(_ask(line, interface), interface)
                ):
                    return f"it answers at {baud} baud, and this is {own}"
        finally:
            port.set_baud(own)
    return _likely(heard, interface)


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
