"""Packets of GDB's remote serial protocol on a byte stream.

GDB manual, appendix "GDB Remote Serial Protocol", Overview: ``$data#checksum``, acknowledged by
``+`` or rejected by ``-`` until both sides agree to omit that. ``}`` escapes a byte, which follows
with bit 5 inverted. A byte 3 between packets stops the target.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

INTERRUPT = 0x03
ESCAPE = ord("}")
ESCAPED_BIT = 0x20
RESERVED = b"#$}*"
"""Bytes that must be escaped; ``*`` starts a repetition, in answers only."""

LARGEST = 0x4000
"""Bytes of a packet's data, as the session announces; longer ones end the connection."""


def escape(data: bytes) -> bytes:
    return b"".join(
        bytes([ESCAPE, byte ^ ESCAPED_BIT]) if byte in RESERVED else bytes([byte]) for byte in data
    )


def unescape(data: bytes) -> bytes:
    head, *parts = data.split(bytes([ESCAPE]))
    return head + b"".join(bytes([part[0] ^ ESCAPED_BIT]) + part[1:] for part in parts if part)


def framed(data: bytes) -> bytes:
    return b"$%b#%02x" % (data, sum(data) & 0xFF)


@dataclass
class Deframer:
    """Splits a client's bytes into packets and interrupts."""

    acknowledging: bool = True  #: whether packets are acknowledged
    #: acknowledgements to send; the owner clears them
    replies: bytearray = field(default_factory=bytearray)
    again: bool = False  #: whether the client requests the last packet again; the owner clears it
    foreign: bool = False  #: whether the client speaks another protocol
    _unread: bytearray = field(default_factory=bytearray)

    def feed(self, data: bytes) -> Iterator[bytes | None]:
        """Data of each complete packet, still escaped; None for an interrupt.

        The first byte that begins neither packet, acknowledgement nor interrupt ends it: what
        follows may be the body of a request that a web page has sent here.
        """
        self._unread += data
        while self._unread and not self.foreign:
            first = self._unread[0]
            if first == ord("$"):
                end = self._unread.find(b"#")
                if (len(self._unread) if end < 0 else end) > LARGEST + 1:
                    self.foreign = True
                    return
                if end < 0 or len(self._unread) < end + 3:
                    return
                body, checksum = bytes(self._unread[1:end]), bytes(self._unread[end + 1 : end + 3])
                del self._unread[: end + 3]
                if not self.acknowledging:
                    yield body
                elif checksum.lower() == b"%02x" % (sum(body) & 0xFF):
                    self.replies += b"+"
                    yield body
                else:
                    self.replies += b"-"
                continue
            del self._unread[0]
            if first == INTERRUPT:
                yield None
            elif first == ord("-"):
                self.again = True
            elif first != ord("+"):
                self.foreign = True
