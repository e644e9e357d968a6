"""A node in memory, driven by the interface tables: what host code talks to in these tests."""

from collections import defaultdict, deque
from collections.abc import Callable
from itertools import cycle
from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES, INTERFACE, AckError
from cubestack.firmware_model.interface.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.interface.message import Kind


class FakeNode:
    """Accepts what the tables allow and shows what a test puts in.

    Attributes:
        values: telemetry name to the fields that differ from their reset value.
        records: name of a stepping telemetry to its records.
        memory: picture memory.
        log: accepted telecommands, (name, parameters).
        busy: polls that answer "not processed" after each telecommand.
        refusals: error codes for the next telecommands.
        lost: answers that the wire swallows.
    """

    def __init__(self) -> None:
        self.values: defaultdict[str, dict[str, Any]] = defaultdict(dict)
        self.records: dict[str, list[dict[str, Any]]] = {}
        self.memory = np.zeros(IMAGE_BYTES, np.uint8)
        self.log: list[tuple[str, dict[str, Any]]] = []
        self.busy = 0
        self.refusals: deque[AckError] = deque()
        self.lost = 0
        self._polls = 0
        self._block = {"BlockNumber": 0, "BlockSize": 2}
        self._steps: dict[str, Any] = {}

    def answer(self, payload: bytes) -> bytes | None:
        """The answer to a message, None for no answer."""
        message = INTERFACE.find(payload[0])
        if message is None:
            return None if payload[0] & 0x80 else bytes([AckError.INVALID_ID])
        if message.kind is Kind.TELEMETRY:
            fields = message.reset_values() | self._telemetry(message.name)
            answer = message.pack(**fields)
        elif len(payload) != 1 + message.length:
            answer = bytes([AckError.WRONG_LENGTH])
        else:
            answer = bytes([self._command(message, payload[1:])])
        if self.lost:
            self.lost -= 1
            return None
        return answer

    def _command(self, message: Any, data: bytes) -> AckError:
        values = message.unpack(data)
        if message.violations(values):
            return AckError.BAD_PARAMETER
        if self.refusals and (error := self.refusals.popleft()):
            return error
        self.log.append((message.name, values))
        self._polls = self.busy
        if message.name == "UploadImage":
            self.memory[:] = 0
            self.values["UploadStatus"]["BlocksReceived"] = 0
        if message.name == "UploadBlock":
            start = 128 * values["BlockNumber"]
            self.memory[start : start + 128] = np.frombuffer(values["Data"], np.uint8)
            status = self.values["UploadStatus"]
            status["BlocksReceived"] = status.get("BlocksReceived", 0) + 1
        if message.name == "ImageBlockSet":
            self._block = values
        return AckError.OK

    def _telemetry(self, name: str) -> dict[str, Any]:
        if name == "TcmdProcessed":
            self._polls -= 1
            return {"Processed": int(self._polls < 0)}
        if name == "ImageBlock":
            start = 128 * self._block["BlockNumber"]
            return {"Block": self.memory[start : start + 128].tobytes()}
        if name in self.records:
            return next(self._steps.setdefault(name, cycle(self.records[name])))
        return self.values[name]


class UartLink:
    """Transport to a node; ``mangle`` changes what the host receives, ``chunk`` its pieces."""

    def __init__(self, node: FakeNode) -> None:
        self.node = node
        self.mangle: Callable[[bytes], bytes] = lambda data: data
        self.chunk = 4096
        self.pending = bytearray()
        self.silences: list[float] = []
        self._decoder = FrameDecoder(256)

    def write(self, data: bytes) -> None:
        for byte in data:
            if self._decoder.feed(byte) is FrameEvent.FRAME:
                answer = self.node.answer(self._decoder.payload)
                if answer is not None:
                    self.pending += self.mangle(encode_frame(answer))

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        size = min(max_bytes, self.chunk)
        data = bytes(self.pending[:size])
        del self.pending[:size]
        if not data:
            self.silences.append(timeout_s)
        return data

    def close(self) -> None:
        pass


class I2cLink:
    """smbus2's ``i2c_rdwr`` to a node at one address."""

    def __init__(self, node: FakeNode, address: int) -> None:
        self.node = node
        self.address = address
        self.failures = 0
        self.waits: list[float] = []

    def i2c_rdwr(self, *messages: Any) -> None:
        self.failures -= 1
        if self.failures >= 0 or any(message.addr != self.address for message in messages):
            raise OSError(121, "Remote I/O error")
        answer = self.node.answer(bytes(messages[0]))
        for message in messages[1:]:
            assert message.flags & 1
            assert message.len == len(answer or b"")
            for index, byte in enumerate(answer or b""):
                message.buf[index] = bytes([byte])


@pytest.fixture
def node() -> FakeNode:
    return FakeNode()


@pytest.fixture
def uart(node: FakeNode) -> UartLink:
    return UartLink(node)


@pytest.fixture
def i2c(node: FakeNode) -> I2cLink:
    return I2cLink(node, INTERFACE.i2c_address)
