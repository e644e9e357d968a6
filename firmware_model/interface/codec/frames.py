"""Frames on the UART of the CubeSpace family of nodes.

A frame is 1F 7F, the payload, 1F FF; a payload byte 1F is sent twice. In a request the payload is
the ID byte and its data; in the node dialect an answer is data alone, or one error byte.
"""

from enum import Enum, auto

ESCAPE = 0x1F
START = 0x7F
END = 0xFF


def encode_frame(payload: bytes) -> bytes:
    """The frame that carries ``payload`` (any length, 0 included)."""
    escaped = payload.replace(bytes((ESCAPE,)), bytes((ESCAPE, ESCAPE)))
    return bytes((ESCAPE, START)) + escaped + bytes((ESCAPE, END))


class FrameEvent(Enum):
    """What a byte brought about."""

    FRAME = auto()
    """A whole frame: its payload is in ``FrameDecoder.payload``."""
    TOO_LONG = auto()
    """A whole frame whose payload exceeds the limit; only the front of it is kept."""
    INCOMPLETE = auto()
    """A start inside a frame: the unfinished one is dropped, the new one has begun."""
    PROTOCOL_ERROR = auto()
    """A byte outside of a frame, or an escape that means nothing; an open frame is dropped."""


class FrameDecoder:
    """Finds frames in a stream of bytes, one byte at a time; no byte sequence raises.

    After anything, the next good frame is found, with one exception that the format itself makes:
    when noise has opened a frame (it holds 1F 7F) and ends in an odd number of 1F, the good
    frame's first 1F completes a doubled data byte, so that frame is swallowed and only the one
    after it is found. A silence on the line (``reset``) ends such a state too.

    Attributes:
        payload: payload of the last whole frame, or the front of it.
        escaped: the last byte was an escape, whose meaning the next one tells.
    """

    def __init__(self, max_length: int) -> None:
        """Accept payloads of at most ``max_length`` bytes; memory is bounded by it."""
        self._max_length = max_length
        self._inside = self.escaped = False
        self._buffer = bytearray()
        self.payload = b""

    def feed(self, byte: int) -> FrameEvent | None:
        """Take the next ``byte``; returns what it completed or broke, None while all is well."""
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

    @property
    def begun(self) -> bytes | None:
        """Payload so far of a frame that has not ended; None outside of one."""
        return bytes(self._buffer) if self._inside else None

    @property
    def unfinished(self) -> bool:
        """Whether a frame has begun and not ended."""
        return self._inside or self.escaped

    def reset(self) -> bool:
        """Forget an unfinished frame, as after a silence; returns whether there was one."""
        unfinished = self.unfinished
        self._inside = self.escaped = False
        return unfinished
