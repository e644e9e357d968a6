"""Frames on the serial line.

As in RFC 1662 (PPP in HDLC-like framing), FLAG is before and after a frame and nowhere inside: a
byte FLAG or ESCAPE of the frame is sent as ESCAPE and the byte with bit 5 inverted. So a receiver
finds the next frame after any garbage. Inside:

    length (2 bytes: of what follows it, without the checksum), number, code, payload, checksum

The checksum is the CRC-32 of everything before it (zlib's), little-endian. Before the escapes, all
bytes are combined by exclusive or with :data:`WHITENING`, so that an image of one colour is not
sent as escapes only.
"""

import zlib
from typing import NamedTuple

from cubestack.firmware_model.interface.devboard.table import ProtocolError

FLAG, ESCAPE, INVERTED = 0x7E, 0x7D, 0x20

#: Bytes of length, number and code before the payload, and of the checksum.
HEAD, CHECKSUM = 4, 4

#: Shift register that whitens the bytes of a frame: its value is combined with a byte, then it is
#: shifted right once, and WHITENING_TAPS are inverted if the bit that left was 1.
WHITENING_START, WHITENING_TAPS = 0xFF, 0xB8

_LONGEST = 2048  # bytes of a frame: more is garbage


def _whitening(count: int) -> bytes:
    register, found = WHITENING_START, bytearray()
    for _ in range(count):
        found.append(register)
        register = register >> 1 ^ (WHITENING_TAPS if register & 1 else 0)
    return bytes(found)


WHITENING = _whitening(_LONGEST)
_FLAGS, _ESCAPES = bytes([FLAG]), bytes([ESCAPE])
_ESCAPED_FLAG, _ESCAPED_ESCAPE = (bytes([ESCAPE, byte ^ INVERTED]) for byte in (FLAG, ESCAPE))


class Frame(NamedTuple):
    """A frame; ``code`` is an operation's (with flags) or a status."""

    number: int
    code: int
    payload: bytes = b""


def _whitened(data: bytes) -> bytes:
    mixed = int.from_bytes(data, "little") ^ int.from_bytes(WHITENING[: len(data)], "little")
    return mixed.to_bytes(len(data), "little")


def buffered(payload: int) -> int:
    """Bytes of a board's buffer that a request takes, from the number of its payload's bytes."""
    return HEAD + payload + CHECKSUM


def encode_frame(frame: Frame) -> bytes:
    """The bytes on the line, with a FLAG before and after."""
    number, code, payload = frame
    body = (2 + len(payload)).to_bytes(2, "little") + bytes([number, code]) + payload
    if len(body) + CHECKSUM > _LONGEST:
        raise ProtocolError(f"a frame has at most {_LONGEST} bytes, not {len(body) + CHECKSUM}")
    sent = _whitened(body + zlib.crc32(body).to_bytes(CHECKSUM, "little"))
    sent = sent.replace(_ESCAPES, _ESCAPED_ESCAPE).replace(_FLAGS, _ESCAPED_FLAG)
    return _FLAGS + sent + _FLAGS


class FrameDecoder:
    """Finds the frames in received bytes.

    Attributes:
        damaged: number of pieces between two FLAGs that are no frame.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._rest = bytearray()

    def feed(self, data: bytes) -> list[Frame]:
        """Take further bytes; returns the frames that they complete."""
        *pieces, rest = (bytes(self._rest) + data).split(_FLAGS)
        if len(rest) > 2 * _LONGEST:  # no frame is so long, also with escapes
            self.damaged += 1
            rest = b""
        self._rest = bytearray(rest)
        found = [self._frame(piece) for piece in pieces if piece]
        self.damaged += found.count(None)
        return [frame for frame in found if frame is not None]

    @staticmethod
    def _frame(piece: bytes) -> Frame | None:
        first, *others = piece.split(_ESCAPES)
        if len(piece) > 2 * _LONGEST or not all(others):
            return None
        plain = first + b"".join(bytes([part[0] ^ INVERTED]) + part[1:] for part in others)
        if not HEAD + CHECKSUM <= len(plain) <= _LONGEST:
            return None
        plain = _whitened(plain)
        body, checksum = plain[:-CHECKSUM], plain[-CHECKSUM:]
        if zlib.crc32(body).to_bytes(CHECKSUM, "little") != checksum:
            return None
        if int.from_bytes(body[:2], "little") != len(body) - 2:
            return None
        return Frame(body[2], body[3], body[HEAD:])
