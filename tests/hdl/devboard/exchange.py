"""A small design behind the reference model and behind a simulated board: the same requests."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, NamedTuple, Protocol

from amaranth.sim import Simulator

import cubestack.emulator.rtl.board_model
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.board_model.board import SimulatedBoard
from cubestack.emulator.rtl.devboard.lines import lines_of
from cubestack.firmware_model.interface.devboard import (
    CHAINED,
    OPERATIONS,
    Code,
    Frame,
    FrameDecoder,
    Step,
    encode_frame,
)
from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.devboard.bridge import BridgeTiming
from cubestack.hdl.devboard.bridged import Bridged, bridged_cxxrtl
from cubestack.hdl.flow.generate import design_hash
from tests.hdl.harness.devboard_model import DevboardModel

NAME = "cubestar"

#: A quick serial line, and a design that settles at once.
QUICK = BridgeTiming(clock_hz=6_000_000, baud=3_000_000, settle=1)


class Board(Protocol):
    def receive(self, data: bytes) -> bytes: ...


class Request(NamedTuple):
    code: int
    payload: bytes = b""


def small_top() -> CubeStarTop:
    return CubeStarTop(8, 4)


class SimulatedDesign:
    """A component in Amaranth's simulator, for the model."""

    def __init__(self, component: PinnedComponent) -> None:
        self._component = component
        contexts: list[Any] = []

        async def lend(context: Any) -> None:
            contexts.append(context)

        simulator = Simulator(component)
        simulator.add_testbench(lend)
        simulator.advance()
        self._context = contexts[0]

    def set(self, levels: dict[str, int]) -> None:
        for name, level in levels.items():
            self._context.set(getattr(self._component, name), level)

    def get(self, name: str) -> int:
        return int(self._context.get(getattr(self._component, name)))


def model(timing: BridgeTiming = QUICK) -> DevboardModel:
    top = small_top()
    identity = bytes.fromhex(design_hash(small_top()))[:8]
    lines = lines_of(cubestar_wiring(top))
    rates = {"clock_hz": timing.clock_hz, "baud": timing.baud}
    design = SimulatedDesign(top)
    return DevboardModel(top.pins, lines, design, name=NAME, design_hash=identity, **rates)


@cache
def _rtl_text(timing: BridgeTiming) -> str:
    top = small_top()
    bridged = Bridged(top, lines_of(cubestar_wiring(top)), timing, NAME)
    return bridged_cxxrtl(bridged, small_top())


def rtl_board(timing: BridgeTiming = QUICK) -> SimulatedBoard:
    """The bridge around the design, before synthesis; powered up."""
    folder = Path(cubestack.emulator.rtl.board_model.__file__).parent
    header = (folder / "cxxrtl_board.h").read_text()
    return SimulatedBoard(header, timing.divider, design=_rtl_text(timing))


def hello(nonce: int = 0) -> Request:
    return Request(Code.HELLO, OPERATIONS[Code.HELLO].request(nonce=nonce))


def frame_requests() -> Iterator[Request]:
    """Two images of the small design with rows that are too long or too short, and a read-out."""
    yield hello()
    blank = Request(Code.RUN, bytes([0, 0, 0, 0, 8, 0]))
    yield Request(Code.STEPS, bytes([Step.SET | 2, 0b100]))  # ENABLE
    for rows in ((10, 5, 8, 3), (8, 10, 8, 12)):
        for levels in (0b100, 0b110):  # VSYNC
            yield Request(Code.STEPS, bytes([Step.SET | 2, levels]))
            yield blank
        for row, length in enumerate(rows):
            pixels = bytes(37 * n + 90 * row & 0xFF for n in range(length))
            yield Request(Code.STORE, bytes(2) + pixels)
            yield blank
            yield blank
    for levels in (0b10, 0b1010, 0b1110):  # RNW instead
        yield Request(Code.STEPS, bytes([Step.SET | 2, levels]))
    yield Request(Code.READ, bytes([0, 1, 0]) + bytes(53 * n & 0xFF for n in range(40)))


#: Bits of the input bytes that must change one at a time: clocks and what they sample.
SINGLE = (0b1, 0, 0b111111, 0)


def random_requests(random: Random, count: int, model: DevboardModel) -> Iterator[Request]:
    """Requests of all kinds, wrong ones too; each for the levels that the model has then."""
    for _ in range(count):
        flags = CHAINED if random.random() < 0.3 else 0
        code = random.choice([*Code, Code.RUN, Code.STORE, Code.STORE, Code.READ, Code.STEPS, 7, 0])
        length = random.choice([0, 1, 2, 5, random.randrange(40)])
        match code:
            case Code.HELLO:
                payload = random.randbytes(4)
            case Code.STEPS:
                levels = list(model.levels.to_bytes(len(SINGLE), "little"))
                payload = b"".join(_step(random, levels) for _ in range(length))
            case Code.RUN:
                sample = [random.randrange(2), random.randrange(256)]
                clocks = random.choice([length, length, 40000])
                payload = bytes([0, 0, *sample]) + clocks.to_bytes(2, "little")
            case Code.STORE:
                payload = bytes(2) + random.randbytes(length)
            case Code.READ:
                payload = bytes([0, random.choice([1, 1, 0, 5]), 0]) + random.randbytes(length)
            case _:
                payload = b""
        if random.random() < 0.04 and code != Code.HELLO:
            payload = bytes([random.randrange(3)]) + payload[1:-1]
        yield Request(code | flags, payload)


def _step(random: Random, levels: list[int]) -> bytes:
    kind = random.choice([Step.SET] * 6 + [Step.CHECK, Step.STAGE])
    number = random.randrange(5)
    if kind == Step.CHECK:
        return bytes([kind | random.randrange(8), random.choice([0, random.randrange(256)])])
    if number < len(SINGLE) and SINGLE[number]:
        levels[number] ^= 1 << random.randrange(8) & SINGLE[number]
        return bytes([Step.SET | number, levels[number]])
    return bytes([kind | number, random.randrange(256)])


def compare(one: Board, other: Board, requests: Iterator[Request], random: Random) -> int:
    """Send the same to both, with repetitions, wrong numbers and garbage; the number of requests.

    Fails at the first response that differs.
    """
    number = count = 0
    sent: list[bytes] = []
    for request in requests:
        frame = encode_frame(Frame(number, *request))
        _same(one, other, frame, request)
        sent.append(frame)
        number, count = (number + 1) % 256, count + 1
        hello = request.code & ~CHAINED == Code.HELLO
        if random.random() < 0.1 and not hello:
            again = random.randrange(1, 9)
            if Code.HELLO not in [FrameDecoder().feed(s)[0].code & 127 for s in sent[-again:]]:
                _same(one, other, sent[-again:][0], request)
        if random.random() < 0.1:
            garbage = b"~" + random.randbytes(20).replace(b"~", b"") + b"~"
            one.receive(garbage), other.receive(garbage)
    return count


def _same(one: Board, other: Board, frame: bytes, request: Request) -> None:
    answers = one.receive(frame), other.receive(frame)
    frames = [FrameDecoder().feed(answer) for answer in answers]
    assert frames[0] == frames[1], request


class Line:
    """A serial line that damages bytes, and a host that sends one request at a time."""

    def __init__(self, board: Board, random: Random, damaged: float) -> None:
        self._board, self._random, self._damaged = board, random, damaged
        self._number = 0
        self.sent = self.received = self.repeated = 0

    def _damage(self, data: bytes) -> bytes:
        return bytes(
            byte ^ self._random.randrange(1, 256) if self._random.random() < self._damaged else byte
            for byte in data
        )

    def request(self, request: Request) -> Frame:
        frame = encode_frame(Frame(self._number, *request))
        while True:
            answer = self._damage(self._board.receive(self._damage(frame)))
            self.sent, self.received = self.sent + len(frame), self.received + len(answer)
            for found in FrameDecoder().feed(answer):
                if found.number == self._number and found.code not in (8, 9):
                    self._number = (self._number + 1) % 256
                    return found
            self.repeated += 1
