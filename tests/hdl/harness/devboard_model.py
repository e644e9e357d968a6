"""Reference model of a development board's side of the protocol, around any pin-level model."""

from collections.abc import Callable, Sequence
from typing import Protocol

from cubestack.firmware_model.interface.devboard import (
    BUFFER,
    CHAINED,
    LONGEST_REQUEST,
    OPERATIONS,
    VERSION,
    WINDOW,
    Code,
    Frame,
    FrameDecoder,
    Identity,
    Layout,
    Lines,
    Outputs,
    ProtocolError,
    Response,
    Status,
    Step,
    encode_deviation,
    encode_frame,
)
from cubestack.firmware_model.interface.devboard.outputs import room
from cubestack.firmware_model.interface.devboard.table import BAUD, DAMAGED, MOST_EDGES, STEP_BYTE
from cubestack.firmware_model.interface.pins import Pin


class Design(Protocol):
    """A design at its pins."""

    def set(self, levels: dict[str, int]) -> None:
        """Change these inputs together; the design settles."""

    def get(self, name: str) -> int:
        """Settled level of an output."""


class DevboardModel:
    """A board; ``receive`` takes the bytes from the host and returns those to the host.

    Attributes:
        executed: number of requests executed, without repetitions.
    """

    def __init__(
        self,
        pins: Sequence[Pin],
        lines: Lines,
        design: Design,
        *,
        name: str = "top",
        design_hash: bytes = bytes(8),
        clock_hz: int = 24_000_000,
        baud: int = BAUD,
    ) -> None:
        self.inputs, self.outputs = Layout.inputs(pins), Layout.outputs(pins)
        self.lines, self.design = lines, design
        sizes = self.inputs.size, self.outputs.size
        self.identity = Identity(
            VERSION, *sizes, WINDOW, BUFFER, LONGEST_REQUEST, clock_hz, baud, design_hash, name
        )
        self.executed = 0
        self._decoder = FrameDecoder()
        self._open = self._ended_early = False
        self._expected = 0
        self._kept: dict[int, bytes] = {}  # the latest responses by number
        self._levels = self._staged = self.inputs.initial
        self._known = Outputs(self.outputs, lines, self._get())

    @property
    def levels(self) -> int:
        """The design's inputs, packed."""
        return self._levels

    def receive(self, data: bytes) -> bytes:
        damaged = self._decoder.damaged
        answers = [self._answer(frame) for frame in self._decoder.feed(data)]
        if self._decoder.damaged > damaged:
            answers.append(self._refusal(DAMAGED))
        return b"".join(answers)

    def _refusal(self, number: int) -> bytes:
        status = Status.NAK if self._open else Status.CLOSED
        return encode_frame(Frame(self._expected, status, Response(status, number).payload()))

    def _answer(self, frame: Frame) -> bytes:
        hello = frame.code & ~CHAINED == Code.HELLO
        if not hello and self._open and frame.number in self._kept:
            return self._kept[frame.number]
        if not hello and (not self._open or frame.number != self._expected):
            return self._refusal(frame.number)
        if hello:
            self._kept.clear()
            self._open = True
            self._ended_early = False
        elif len(self._kept) == WINDOW:
            del self._kept[(frame.number - WINDOW) % 256]
        response = self._execute(frame)
        self._expected = (frame.number + 1) % 256
        sent = encode_frame(Frame(frame.number, response.status, response.payload()))
        self._kept[frame.number] = sent
        return sent

    def _execute(self, frame: Frame) -> Response:
        if self._ended_early and frame.code & CHAINED:
            return Response(Status.SKIPPED, 0)
        self.executed += 1
        try:
            operation = OPERATIONS[Code(frame.code & ~CHAINED)]
            values, data = operation.parse(frame.payload)
            act: Callable[..., Response] = getattr(self, f"_{operation.code.name.lower()}")
            places = {"camera": len(self.lines.cameras), "memory": len(self.lines.memories)}
            if any(values[name] >= count for name, count in places.items() if name in values):
                raise ProtocolError("no such camera or memory")
            response = act(data, **values) if operation.data else act(**values)
        except ValueError:
            response = Response(Status.REJECTED, 0)
        self._ended_early = response.status is not Status.OK
        return response

    def _get(self) -> int:
        outputs = 0
        for name in self.outputs.ports:
            outputs = self.outputs.put(outputs, name, self.design.get(name))
        return outputs

    def _set(self, levels: int) -> None:
        now = self.inputs.unpack(levels)
        before = self.inputs.unpack(self._levels)
        self._levels = self._staged = levels
        self.design.set({name: now[name] for name in now if now[name] != before[name]})

    def _put(self, levels: int, **ports: int) -> int:
        for name, level in ports.items():
            levels = self.inputs.put(levels, name, level)
        return levels

    def _hello(self, nonce: int) -> Response:
        self._set(self.inputs.initial)
        self._known.start(self._get())
        outputs = self._known.now.to_bytes(self.outputs.size, "little")
        return Response(Status.OK, 0, nonce.to_bytes(4, "little") + self.identity.pack() + outputs)

    def _outputs(self) -> Response:
        self._known.now = self._get()
        return Response(Status.OK, 0, self._known.now.to_bytes(self.outputs.size, "little"))

    def _steps(self, data: bytes) -> Response:
        records = b""
        count = len(data) // 2
        for done in range(count):
            step, value = data[2 * done : 2 * done + 2]
            kind, number = step & ~STEP_BYTE, step & STEP_BYTE
            if kind == Step.CHECK:
                if self._known.now >> 8 * number & 0xFF != value:
                    return Response(Status.CHECK, done, records)
                continue
            if number < self.inputs.size:
                shift = 8 * number
                self._staged = self._staged & ~(0xFF << shift) | value << shift
            if kind == Step.SET:
                self._set(self._staged)
                found = self._get()
                records += encode_deviation(done, self._known.now, found)
                self._known.now = found
                if len(records) > room(self.outputs.size) and done + 1 < count:
                    return Response(Status.FULL, done + 1, records)
        return Response(Status.OK, count, records)

    def _run(self, camera: int, memory: int, line: int, pixel: int, clocks: int) -> Response:
        if 2 * clocks > MOST_EDGES:
            raise ProtocolError(f"{clocks} clocks are too many")
        return self._clocks(camera, memory, line, [pixel] * clocks)

    def _store(self, pixels: bytes, camera: int, memory: int) -> Response:
        return self._clocks(camera, memory, 1, pixels)

    def _clocks(self, camera: int, memory: int, line: int, pixels: Sequence[int]) -> Response:
        ports, records = self.lines.cameras[camera], b""
        for clock, pixel in enumerate(pixels):
            for rising in (True, False):
                predicted = self._known.predict(rising)
                if rising:
                    level = self.inputs.get(self._levels, ports.data)
                    predicted = self._known.predict_store(memory, level)
                    self._set(self._put(self._levels, **{ports.clock: 1}))
                else:
                    self._set(self._put(self._levels, **{ports.clock: 0}))
                    sample = {ports.data: pixel, ports.line: line & 1}
                    self._set(self._put(self._levels, **sample))
                acknowledged = self._acknowledged(self._known.now)
                self._follow_bus()
                found = self._get()
                position = 2 * clock + (not rising)
                records += encode_deviation(position, predicted, found)
                self._known.edge(rising, found)
                if self._acknowledged(found) != acknowledged:
                    return Response(Status.ACKNOWLEDGE, position + 1, records)
                if self._reads(found):
                    return Response(Status.READS, position + 1, records)
            if len(records) > room(self.outputs.size) and clock + 1 < len(pixels):
                return Response(Status.FULL, 2 * clock + 2, records)
        return Response(Status.OK, 2 * len(pixels), records)

    def _acknowledged(self, outputs: int) -> list[int]:
        return [self.outputs.get(outputs, name) for name in self.lines.acknowledges]

    def _reads(self, outputs: int) -> bool:
        return any(
            not self.outputs.get(outputs, memory.ce_n)
            and not self.outputs.get(outputs, memory.oe_n)
            and self.outputs.get(outputs, memory.we_n)
            for memory in self.lines.memories
        )

    def _follow_bus(self) -> None:
        """Each memory's data input follows its data output, or is 0."""
        outputs, levels = self._get(), self._levels
        for memory in self.lines.memories:
            drives = self.outputs.get(outputs, memory.drives)
            level = self.outputs.get(outputs, memory.data_out) if drives else 0
            levels = self._put(levels, **{memory.data_in: level})
        self._set(levels)

    def _read(self, data: bytes, memory: int, step: int) -> Response:
        ports, records = self.lines.memories[memory], b""
        for clock, byte in enumerate(data):
            for rising in (True, False):
                predicted = self._known.predict(rising)
                if rising:
                    offered = self.inputs.get(self._levels, ports.data_in)
                    predicted = self._known.predict_read(memory, step, offered)
                self._set(self._put(self._levels, **{self.lines.data_clock: int(rising)}))
                address = self.outputs.get(predicted, ports.address)
                if rising and self.outputs.get(self._get(), ports.address) == address:
                    self._set(self._put(self._levels, **{ports.data_in: byte}))
                found = self._get()
                position = 2 * clock + (not rising)
                records += encode_deviation(position, predicted, found)
                self._known.edge(rising, found)
                if self.outputs.get(found, ports.address) != address:
                    return Response(Status.ADDRESS, position + 1, records)
            if len(records) > room(self.outputs.size) and clock + 1 < len(data):
                return Response(Status.FULL, 2 * clock + 2, records)
        return Response(Status.OK, 2 * len(data), records)
