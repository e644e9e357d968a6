"""Why a node on a serial line gives no answer, found by asking it at other baud rates."""

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
"""Those that are usual, the likeliest first."""

SILENCE_S = 0.3
"""Wall time after which no more of an answer comes."""

MOST_BYTES = 512


def why_silent(line: Transport, interface: Interface) -> str:
    """What is likely to be wrong with a line on which ``interface``'s node does not answer.

    Asks for telemetry that changes nothing, at the line's baud rate and at others, and leaves the
    rate as it was. Empty when it answers, and for lines that are no port: recordings, emulations in
    this process. Raises TransportError.
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
        return "nothing comes: is it powered, is this its port, are its two lines crossed?"
    if heard == _request(interface):
        return "what is sent comes back: nobody but an echo is there"
    payload = _payload(heard)
    shown = (heard if payload is None else payload)[:8].hex(" ")
    if payload is not None:
        return f"a node answers, but not as {interface.name} does: is it another device? ({shown})"
    return f"bytes come, but no frame: does it speak the node protocol at this rate? ({shown})"


def _request(interface: Interface) -> bytes:
    return encode_frame(bytes([interface.telemetries[0].id]))


def _ask(line: Transport, interface: Interface) -> bytes:
    """What comes after a request."""
    read_answer(line, 1 << 20, 0.0)  # what came before
    line.write(_request(interface))
    return read_answer(line, MOST_BYTES, SILENCE_S)


def _answers(heard: bytes, interface: Interface) -> bool:
    payload = _payload(heard)
    return payload is not None and len(payload) == interface.telemetries[0].length


def _payload(heard: bytes) -> bytes | None:
    """Of the first whole frame; None without any."""
    decoder = FrameDecoder(MOST_BYTES)
    whole = (decoder.payload for byte in heard if decoder.feed(byte) is FrameEvent.FRAME)
    return next(whole, None)
