"""Client of a node on a UART, node dialect of the CubeSpace family.

A telemetry answer has data but no ID; a telecommand's answer is one error byte. So an answer
belongs to the request before it, and only one request is pending at a time.
"""

from collections.abc import Iterator

from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.codec.frames import (
    BACK,
    FrameDecoder,
    FrameEvent,
    encode_frame,
)
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.host.clients.contract import Client
from cubestack.host.errors import BadAnswerError, NoAnswerError
from cubestack.host.transport.streams import Transport, read_frame_part

READ_BYTES = 4096

#: Reads without a whole frame until a babbling line counts as a time-out.
MAX_READS = 1000


class NodeClient(Client):
    """Client on a byte transport."""

    def __init__(
        self,
        transport: Transport,
        interface: Interface,
        *,
        timeout_s: float = 1.0,
        retries: int = 2,
    ) -> None:
        """Talk to the node of ``interface`` over ``transport``.

        ``timeout_s`` is the longest silence before or within an answer. Telemetry requests are
        repeated up to ``retries`` times; telecommands never, as they may have been executed.
        """
        self.interface = interface
        self._transport = transport
        self._timeout_s = timeout_s
        self._retries = retries
        longest = max(message.length for message in interface.telemetries)
        self._decoder = FrameDecoder(longest)
        self._unread: Iterator[int] = iter(b"")

    def command(self, name: str, **parameters: object) -> None:
        """Send a telecommand and read its acknowledge; errors as ``Client``'s."""
        message = self.interface.telecommand(name)
        answer = self.request(bytes([message.id]) + message.pack(**parameters))
        if answer is None:
            raise NoAnswerError(
                f"no acknowledge of telecommand {message.name} within {self._timeout_s:g} s"
            )
        if len(answer) != 1:
            raise BadAnswerError(
                f"acknowledge of telecommand {message.name} has {len(answer)} bytes, not 1"
            )
        self._check_error(message, answer[0])

    def telemetry(self, name: str) -> dict[str, Value]:
        """Request a telemetry frame; a stepping one may skip a record after a lost answer."""
        message = self._asked(name)
        answer = None
        for attempt in range(1 + self._retries):
            self.exchanges.repeated += attempt > 0
            answer = self.request(bytes([message.id]))
            if answer is not None and len(answer) == message.length:
                return message.unpack(answer)
        attempts = f"in {1 + self._retries} attempts"
        if answer is None:
            raise NoAnswerError(
                f"no answer to telemetry {message.name} within {self._timeout_s:g} s {attempts}"
            )
        raise BadAnswerError(
            f"telemetry {message.name} has {len(answer)} bytes, not {message.length}, {attempts}"
        )

    def request(self, payload: bytes) -> bytes | None:
        """Drop earlier bytes, send a frame; returns the next frame's payload, or None."""
        return self.exchange(encode_frame(payload))

    def exchange(self, wire: bytes, rest: bytes = b"") -> bytes | None:
        """Send raw bytes, ``rest`` separately; returns as ``request`` does."""
        self._decoder.reset()
        self._unread = iter(b"")
        for _ in range(MAX_READS):
            if not self._transport.read(READ_BYTES, 0.0):
                break
        self._transport.write(wire)
        if rest:
            self._transport.write(rest)
        self.exchanges.sent += 1
        answer = self._next_frame()
        self.exchanges.ended(answer is not None)
        return answer

    def stream(self, name: str, count: int) -> Iterator[bytes]:
        """Send telecommand ``name``, then yield the payloads of the next ``count`` frames."""
        self.command(name)
        for number in range(count):
            payload = self._next_frame()
            if payload is None:
                raise NoAnswerError(f"{name}: the stream ended after {number} of {count} frames")
            self.exchanges.streamed += 1
            yield payload

    def _next_frame(self) -> bytes | None:
        """Payload of the next whole frame; None if the line stays silent."""
        for _ in range(MAX_READS):
            for byte in self._unread:
                if self._decoder.feed(byte) is FrameEvent.FRAME:
                    return self._decoder.payload
            data = read_frame_part(self._transport, BACK, self._timeout_s)
            if not data:
                return None
            if self._decoder.takes(data):
                return self._decoder.payload
            self._unread = iter(data)
        return None

    def pause(self, seconds: float) -> None:
        """Let time pass; ends early if the node sends something, which is lost."""
        self._transport.read(READ_BYTES, seconds)

    def close(self) -> None:
        self._transport.close()
