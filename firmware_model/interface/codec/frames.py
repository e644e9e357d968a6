"""Frames on the UART of the CubeSpace family of nodes.

A frame is 1F 7F, the payload, 1F FF; a payload byte 1F is sent twice. In a request the payload is
the ID byte and its data; in the node dialect an answer is data alone, or one error byte.
"""

from enum import Enum, auto

ESCAPE = 0x1F
START = 0x7F
END = 0xFF
FRONT, BACK = bytes((ESCAPE, START)), bytes((ESCAPE, END))
_ONE, _TWO = bytes((ESCAPE,)), bytes((ESCAPE, ESCAPE))


def encode_frame(payload: bytes) -> bytes:
    """The frame with ``payload``, which may be empty."""
    return FRONT + payload.replace(_ONE, _TWO) + BACK


class FrameEvent(Enum):
    """Result of a received byte."""

    FRAME = auto()  #: a complete frame: its payload is in ``FrameDecoder.payload``
    TOO_LONG = auto()  #: a complete frame whose payload exceeds the limit; only its front is kept
    INCOMPLETE = auto()
    """A start inside a frame: the unfinished one is dropped, the new one has begun."""
    PROTOCOL_ERROR = auto()
    """A byte outside of a frame, or an unknown escape; an open frame is dropped."""


class FrameDecoder:
    """Finds frames in a stream of bytes, one byte at a time; no byte sequence raises.

    After any input the next good frame is found, with one exception that the format causes: when
    noise has opened a frame (it contains 1F 7F) and ends in an odd number of 1F, the good frame's
    first 1F completes a doubled data byte, so that frame is lost and only the one after it is
    found. A silence on the line (``reset``) ends such a state too.
    """

    def __init__(self, max_length: int) -> None:
        """Accept payloads of at most ``max_length`` bytes, which also bounds the memory."""
        self._max_length = max_length
        #: escaped: the last byte was an escape; the next byte determines its meaning
        self._inside = self.escaped = False
        self._buffer = bytearray()
        self.payload = b""  #: payload of the last complete frame, or its front

    def feed(self, byte: int) -> FrameEvent | None:
        """Process the next ``byte``; returns what it completed or broke, else None."""
        inside, escaped = self._inside, self.escaped
        self.escaped = not escaped and byte == ESCAPE
        if self.escaped:
            return None
        if not escaped or byte == ESCAPE:
            if inside:
                if len(self._buffer) <= self._max_length:
                    self._buffer.append(byte)
                return None
            self.escaped = escaped  # after 1F 1F the second one may still begin a frame
            return FrameEvent.PROTOCOL_ERROR
        self._inside = byte == START
        if byte == START:
            self._buffer.clear()
            return FrameEvent.INCOMPLETE if inside else None
        if byte != END or not inside:
            return FrameEvent.PROTOCOL_ERROR
        self.payload = bytes(self._buffer[: self._max_length])
        return FrameEvent.TOO_LONG if len(self._buffer) > self._max_length else FrameEvent.FRAME

    def takes(self, block: bytes) -> bool:
        """Whether ``block`` is one frame, outside of another; then its payload is in ``payload``,
        and ``feed`` of each byte would have done the same."""
        if self._inside or self.escaped or block[:2] != FRONT or block[-2:] != BACK:
            return False
        payload = block[2:-2]
        if ESCAPE in payload:
            if ESCAPE in payload.replace(_TWO, b""):
                return False
            payload = payload.replace(_TWO, _ONE)
        if len(payload) > self._max_length:
            return False
        self.payload = payload
        return True

    @property
    def open_payload(self) -> bytes | None:
        """Payload so far of an open frame; None outside of one."""
        return bytes(self._buffer) if self._inside else None

    @property
    def unfinished(self) -> bool:
        return self._inside or self.escaped

    def reset(self) -> bool:
        """Drop an unfinished frame, as after a silence; returns whether there was one."""
        unfinished = self.unfinished
        self._inside = self.escaped = False
        return unfinished
