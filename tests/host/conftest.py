"""Fake nodes that are driven by the interface tables."""

from collections import defaultdict, deque
from collections.abc import Callable
from itertools import cycle
from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.interface.codec.message import Interface, MessageKind
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES, INTERFACE, AckError
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient


class FakeNode:
    """Accepts what the tables allow and shows what a test puts in.

    Attributes:
        values: telemetry name to the fields that differ from their reset value.
        records: name of a stepping telemetry to its records.
        log: accepted telecommands, (name, parameters).
        busy: polls that answer "not processed" after each telecommand.
        refusals: error codes for the next telecommands.
        lost: answers that the wire swallows.
    """

    def __init__(self, interface: Interface) -> None:
        self.interface = interface
        self.values: defaultdict[str, dict[str, Any]] = defaultdict(dict)
        self.records: dict[str, list[dict[str, Any]]] = {}
        self.log: list[tuple[str, dict[str, Any]]] = []
        self.busy = 0
        self.refusals: deque[AckError] = deque()
        self.lost = 0
        self._polls = 0
        self._steps: dict[str, Any] = {}

    def answer(self, payload: bytes) -> bytes | None:
        """The answer to a message, None for no answer."""
        message = self.interface.find(payload[0])
        if message is None:
            return None if payload[0] & 0x80 else bytes([AckError.INVALID_ID])
        if message.kind is MessageKind.TELEMETRY:
            fields = message.reset_values() | self.telemetry(message.name)
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
        self.execute(message.name, values)
        return AckError.OK

    def execute(self, name: str, values: dict[str, Any]) -> None:
        """Execute an accepted telecommand."""

    def telemetry(self, name: str) -> dict[str, Any]:
        """The fields of a telemetry frame that differ from their reset value."""
        if name == "TcmdProcessed":
            self._polls -= 1
            return self.values[name] | {"Processed": int(self._polls < 0)}
        if name in self.records:
            return next(self._steps.setdefault(name, cycle(self.records[name])))
        return self.values[name]


class FakeCubeStar(FakeNode):
    """Stores uploads in ``memory``."""

    def __init__(self) -> None:
        super().__init__(INTERFACE)
        self.memory = np.zeros(IMAGE_BYTES, np.uint8)
        self._block = {"BlockNumber": 0, "BlockSize": 2}

    def execute(self, name: str, values: dict[str, Any]) -> None:
        if name == "UploadImage":
            self.memory[:] = 0
            self.values["UploadStatus"]["BlocksReceived"] = 0
        if name == "UploadBlock":
            start = 128 * values["BlockNumber"]
            self.memory[start : start + 128] = np.frombuffer(values["Data"], np.uint8)
            status = self.values["UploadStatus"]
            status["BlocksReceived"] = status.get("BlocksReceived", 0) + 1
        if name == "ImageBlockSet":
            self._block = values

    def telemetry(self, name: str) -> dict[str, Any]:
        if name == "ImageBlock":
            start = 128 * self._block["BlockNumber"]
            return {"Block": self.memory[start : start + 128].tobytes()}
        return super().telemetry(name)


class FakeCubeSense(FakeNode):
    """Measures what a test puts in, and sends pictures in frames.

    Attributes:
        pictures: the picture (480, 640) in each memory.
        outcomes: fields of a camera's result once the measurement is done.
        capturing, detecting: polls of a result that answer pending after a telecommand.
        preparing: polls of ImageFrameInfo before a frame is ready.
        damaged: reads of ImageFrame that come with a wrong byte.
    """

    def __init__(self) -> None:
        super().__init__(CUBESENSE)
        self.pictures = np.zeros((2, 480, 640), np.uint8)
        self.outcomes: list[dict[str, Any]] = [{}, {}]
        self.capturing = self.detecting = self.preparing = self.damaged = 0
        self._results: list[deque[dict[str, Any]]] = [deque([{}]), deque([{}])]
        self._frames = np.zeros((0, 128), np.uint8)
        self._frame = 0
        self._unready = 0

    def execute(self, name: str, values: dict[str, Any]) -> None:
        if name in ("CaptureAndDetect", "CaptureOnly"):
            self._start(values["Camera"], name == "CaptureAndDetect")
        if name == "StartImageDownload":
            canvas = np.pad(self.pictures[values["Sram"]], ((272, 272), (192, 192)))
            step = 1 << values["Size"]
            self._frames = canvas[::step, ::step].reshape(-1, 128)
        if name in ("StartImageDownload", "NextImageFrame"):
            self._frame = values.get("Frame", 0)
            self._unready = self.preparing

    def _start(self, camera: int, detect: bool) -> None:
        busy = {"Capture": 1, "Detect": 2 if detect else 1}
        self._results[camera] = deque(
            [busy] * self.capturing
            + [busy | {"Capture": 2}] * (self.detecting if detect else 0)
            + [self.outcomes[camera]]
        )

    def telemetry(self, name: str) -> dict[str, Any]:
        if name.startswith("Result"):
            camera = int(name[len("Result")]) - 1
            results = self._results[camera]
            found = results.popleft() if len(results) > 1 else results[0]
            if "Then" in name:
                self.log.append((name, found))
                self._start(camera, True)
            return found
        if name == "ImageFrameInfo":
            self._unready -= 1
            if self._unready >= 0:
                return {}
            check = int(np.bitwise_xor.reduce(self._frames[self._frame]))
            return {"FrameNumber": self._frame, "Checksum": check}
        if name == "ImageFrame":
            frame = self._frames[self._frame].copy()
            self.damaged -= 1
            if self.damaged >= 0:
                frame[7] ^= 0x40
            return {"Frame": frame.tobytes()}
        return super().telemetry(name)


class Line:
    """Returns ``pending`` in pieces of ``chunk`` bytes and counts empty reads."""

    def __init__(self) -> None:
        self.pending = bytearray()
        self.chunk = 4096
        self.silences: list[float] = []

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        size = min(max_bytes, self.chunk)
        data = bytes(self.pending[:size])
        del self.pending[:size]
        if not data:
            self.silences.append(timeout_s)
        return data

    def close(self) -> None:
        pass


class LetterLine(Line):
    """A serial line with an answer for each letter."""

    def __init__(self, **answers: bytes) -> None:
        super().__init__()
        self.answers = answers
        self.requests = b""

    def write(self, data: bytes) -> None:
        self.requests += data
        self.pending += self.answers.get(data.decode("latin-1"), b"")


class UartLink(Line):
    """Transport to a node; ``mangle`` changes what the host receives.

    ``later`` is what comes behind the next answer.
    """

    def __init__(self, node: FakeNode) -> None:
        super().__init__()
        self.node = node
        self.mangle: Callable[[bytes], bytes] = lambda data: data
        self.later = bytearray()
        self._decoder = FrameDecoder(256)

    def write(self, data: bytes) -> None:
        for byte in data:
            if self._decoder.feed(byte) is FrameEvent.FRAME:
                answer = self.node.answer(self._decoder.payload)
                if answer is not None:
                    self.pending += self.mangle(encode_frame(answer)) + self.later
                    self.later.clear()


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


class Slave:
    """Registers with an address pointer and smbus2's ``i2c_rdwr``."""

    def __init__(self) -> None:
        self.content: dict[int, bytes] = {}
        self.written: list[bytes] = []
        self.failures: list[int] = []  # numbers of the transfers that are not acknowledged
        self.waits: list[float] = []
        self.transfers = 0
        self.longest = 0
        self._rest = b""

    def i2c_rdwr(self, *messages: Any) -> None:
        number, self.transfers = self.transfers, self.transfers + 1
        if number in self.failures or any(message.addr != 0x1C for message in messages):
            raise OSError(121, "Remote I/O error")
        for message in messages:
            if message.flags & 1:
                self.longest = max(self.longest, message.len)
                data = self._rest[: message.len].ljust(message.len, b"\xff")
                self._rest = self._rest[message.len :]
                for index, byte in enumerate(data):
                    message.buf[index] = bytes([byte])
            else:
                pointer, *values = bytes(message)
                self._rest = self.content.get(pointer, b"")
                if values:
                    self.content[pointer] = bytes(values)
                    self.written.append(bytes(message))


def over_i2c(node: FakeNode) -> I2cClient:
    """A client of ``node`` on an I2C bus; does not wait."""
    return I2cClient(
        I2cLink(node, node.interface.i2c_address), node.interface, wait=lambda _s: None
    )


@pytest.fixture
def node() -> FakeCubeStar:
    return FakeCubeStar()


@pytest.fixture
def uart(node: FakeNode) -> UartLink:
    return UartLink(node)


@pytest.fixture
def i2c(node: FakeNode) -> I2cLink:
    return I2cLink(node, node.interface.i2c_address)


@pytest.fixture(params=["uart", "i2c"])
def either_client(request: pytest.FixtureRequest, node: FakeNode) -> NodeClient | I2cClient:
    """A client of the node on each of its ports."""
    if request.param == "i2c":
        return over_i2c(node)
    return NodeClient(request.getfixturevalue("uart"), node.interface)


@pytest.fixture
def sense() -> FakeCubeSense:
    return FakeCubeSense()
