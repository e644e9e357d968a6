"""Compares a development board with the compiled engine over random operation and whole frames.

Both engines take the same steps from the same state. After each step, pins, memories, broken rules
and bytes read must be the same. After a difference, both repeat all steps from the start, and the
step that differs in smaller and smaller pieces, down to single edges.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.sram import ViolationKind, no_log
from cubestack.emulator.rtl.wiring import Wiring

PERIOD_PS = 100_000
"""Of the pixel clocks; those of two cameras differ a little."""

READ_PS = Fraction(770_833)
"""Period of the data clock."""

WAVES = 40
"""Moments that are kept before a difference."""

_PIECES = 16

_MOST_ROWS = 2048
"""Rows after which a frame ends without an acknowledge."""


class _Rows(NamedTuple):
    """A segment of rows; see ``PixelSegment``."""

    start_ps: int
    clocks: int
    vsync: int
    rows: int
    pixels: Callable[[], NDArray[np.uint8]] | None


@dataclass
class RandomPixels:
    """A camera that sends random rows without end, after ``blank`` clocks without a line."""

    columns: int
    seed: int
    period: Fraction
    blank: int
    start_ps: int = 0
    rows: int = 16  #: of a segment
    line_clocks: int = field(init=False)

    def __post_init__(self) -> None:
        self.line_clocks = self.columns + 40

    @property
    def active_columns(self) -> int:
        return self.columns

    def segment_at(self, time_ps: int) -> _Rows | None:
        if time_ps < self.start_ps:
            return None
        begin = self.start_ps + int(self.blank * self.period)
        if time_ps < begin:
            return _Rows(self.start_ps, self.blank, 0, 0, None)
        clocks = self.rows * self.line_clocks
        number = int((time_ps - begin + Fraction(1, 2)) / (clocks * self.period))
        if begin + int((number + 1) * clocks * self.period) <= time_ps:
            number += 1
        shape = self.rows, self.columns

        def render() -> NDArray[np.uint8]:
            return np.random.default_rng([self.seed, number]).integers(0, 256, shape, np.uint8)

        return _Rows(begin + int(number * clocks * self.period), clocks, 1, self.rows, render)


@dataclass(frozen=True)
class Step:
    """What both engines do.

    Attributes:
        text: what it is, for a report.
        pins: levels that the microcontroller sets first, one after the other.
        sources: cameras that then begin to send, None to remove one.
        span_ps: time to run.
        stop_on: acknowledge at whose rise the time ends.
        reads: bytes to read.
    """

    text: str
    pins: tuple[tuple[str, int], ...] = ()
    sources: tuple[tuple[str, RandomPixels | None], ...] = ()
    span_ps: int = 0
    stop_on: str = ""
    reads: int = 0

    def take(self, engine: RtlEngine) -> bytes:
        """Returns the bytes read."""
        for pin, level in self.pins:
            engine.set_pin(pin, level)
        for name, source in self.sources:
            engine.attach(source and replace(source, start_ps=engine.now_ps), name)
        if self.span_ps:
            stop_on = (self.stop_on, 1) if self.stop_on else None
            engine.run(engine.now_ps + self.span_ps, stop_on)
        if not self.reads:
            return b""
        out = np.zeros(self.reads, np.uint8)
        done = engine.strobe_read(out, READ_PS, engine.now_ps + int((self.reads + 1) * READ_PS))
        return out[:done].tobytes()


class Wave(NamedTuple):
    """Levels of the pins at one time, on the board and in the compiled engine."""

    time_ps: int
    board: dict[str, int]
    compiled: dict[str, int]


@dataclass(frozen=True)
class Found:
    """The first difference.

    Attributes:
        step: number and text of the step.
        texts: what differs, a line each.
        waves: pins before and at the difference.
        repeated: whether it came again when the steps were repeated.
    """

    step: str
    texts: Sequence[str]
    waves: Sequence[Wave]
    repeated: bool


class BoardCheck:
    """The steps for a wiring, and the comparison."""

    def __init__(
        self,
        wiring: Wiring,
        board: Callable[[], RtlEngine],
        compiled: Callable[[], RtlEngine],
        *,
        seed: int = 0,
        steps: int = 200,
        frames: int = 1,
        columns: int | None = None,
    ) -> None:
        """``board`` and ``compiled`` create engines; the one before is closed.

        Args:
            wiring: of the design.
            board: opens the board.
            compiled: creates the engine to compare with.
            seed: of the random steps.
            steps: number of random steps.
            frames: whole frames for each way to store one camera's image.
            columns: pixels per row; None for those of the design's strides, or 1024.
        """
        self._wiring, self._makers = wiring, (board, compiled)
        self._rng = np.random.default_rng(seed)
        self._seed = seed
        strides = wiring.component.strides
        self._columns = columns or max((stride.last + 1 for stride in strides), default=1024)
        lines = [name for name in wiring.mcu_pins if wiring.widths[name] == 1]
        clocks = {wiring.data_clock}
        if wiring.bus is not None:
            bus = wiring.bus
            clocks |= {*bus.selects, bus.latch, bus.read, bus.write}
        self._lines = [name for name in lines if name not in clocks]
        self._idle = tuple((name, wiring.initial[name]) for name in self._lines)
        with no_log():
            self._storing, self._reading = self._modes()
        self._broken: list[Counter[ViolationKind]] = []  # rules at the start
        self._steps = [*self._frame_steps(frames), *self._random_steps(steps)]

    def __len__(self) -> int:
        return len(self._steps)

    def run(self) -> Iterator[Found | None]:
        """Per step None, or the first difference, which is the last result."""
        with no_log():
            board, compiled = self._start()
            try:
                for number, step in enumerate(self._steps):
                    texts = self._difference(board, compiled, step)
                    if texts:
                        name = f"step {number + 1}, {step.text}"
                        board.close()
                        yield self._explain(number, name, texts)
                        return
                    yield None
            finally:
                board.close()
                compiled.close()

    # --- steps ------------------------------------------------------------------------------------

    def _modes(self) -> tuple[list[tuple[int, ...]], list[tuple[int, ...]]]:
        """Levels of the lines at which an image is stored, and at which a memory is read."""
        storing, reading = [], []
        engine = self._makers[1]()
        try:
            for levels in product((0, 1), repeat=len(self._lines)):
                for pin, level in (*self._idle, *zip(self._lines, levels, strict=True)):
                    engine.set_pin(pin, level)
                if self._wiring.storing(engine.get_pin):
                    storing.append(levels)
                elif self._wiring.bus is None and any(
                    (engine.get_pin(memory["CE_N"]), engine.get_pin(memory["OE_N"])) == (0, 0)
                    for memory in self._wiring.memories
                ):
                    reading.append(levels)
        finally:
            engine.close()
        return storing, reading

    def _to(self, levels: tuple[int, ...]) -> tuple[tuple[str, int], ...]:
        return (*self._idle, *zip(self._lines, levels, strict=True))

    def _sources(self, seed: int) -> tuple[tuple[str, RandomPixels], ...]:
        blank = max(100, 2 * self._wiring.settling_clocks)
        return tuple(
            (
                camera.name,
                RandomPixels(self._columns, seed + n, PERIOD_PS + Fraction(n * 997, 7), blank),
            )
            for n, camera in enumerate(self._wiring.cameras)
        )

    def _frame_steps(self, frames: int) -> Iterator[Step]:
        row_ps = (self._columns + 40) * PERIOD_PS
        for number in range(frames):
            for levels in self._storing:
                begin = Step(
                    f"frame {number + 1}: {self._words(levels)}",
                    self._to(levels),
                    self._sources(self._seed + number),
                )
                yield begin
                ack, rows = self._rows(begin)
                for row in range(0, rows, 16):
                    yield Step(f"rows from {row}", span_ps=16 * row_ps, stop_on=ack)
                yield Step("rest of the frame", span_ps=row_ps)
                for reads in self._reading:
                    yield Step(f"read-out: {self._words(reads)}", self._to(reads), span_ps=50_000)
                    yield Step("bytes", reads=2 * self._columns + 3)
                yield Step("idle", self._idle, span_ps=50_000)

    def _rows(self, begin: Step) -> tuple[str, int]:
        """The acknowledge that rises first, and the rows until then, of the compiled engine."""
        row_ps = (self._columns + 40) * PERIOD_PS
        found = []
        for ack in self._wiring.acknowledges:
            engine = self._makers[1]()
            try:
                begin.take(engine)
                if len(self._wiring.storing(engine.get_pin)) > 1:
                    return ack, 2  # edge by edge, as the board has no operation for two cameras
                engine.run(_MOST_ROWS * row_ps, (ack, 1))
                found.append((engine.now_ps // row_ps + 2, ack))
            finally:
                engine.close()
        rows, ack = min(found)
        return ack, rows if rows < _MOST_ROWS else 32

    def _words(self, levels: tuple[int, ...]) -> str:
        return " ".join(f"{pin}={level}" for pin, level in zip(self._lines, levels, strict=True))

    def _random_steps(self, count: int) -> Iterator[Step]:
        rng, row_ps = self._rng, (self._columns + 40) * PERIOD_PS
        for _ in range(count):
            match rng.choice(
                ["pin", "mode", "run", "read", "camera"], p=[0.3, 0.2, 0.2, 0.25, 0.05]
            ):
                case "pin":
                    pin = str(rng.choice(self._wiring.mcu_pins))
                    level = int(rng.integers(0, 1 << self._wiring.widths[pin]))
                    wait = int(rng.integers(1, 300_000))
                    yield Step(f"{pin}={level:X}", ((pin, level),), span_ps=wait)
                case "mode":
                    modes = [*self._storing, *self._reading]
                    levels = modes[rng.integers(len(modes))]
                    yield Step(self._words(levels), self._to(levels), span_ps=60_000)
                case "run":
                    yield Step("time passes", span_ps=int(rng.integers(1, 2 * row_ps)))
                case "read":
                    yield Step("bytes", reads=int(rng.integers(1, 60)))
                case _:
                    chosen = self._sources(int(rng.integers(1 << 30)))
                    kept = rng.random() < 0.7
                    name, source = chosen[rng.integers(len(chosen))]
                    yield Step("camera", sources=((name, source if kept else None),))

    # --- comparison -------------------------------------------------------------------------------

    def _start(self) -> tuple[RtlEngine, RtlEngine]:
        """New engines, after each line was high once: the board may have run before."""
        board, compiled = (make() for make in self._makers)
        for engine in (board, compiled):
            for name in (*self._lines, self._wiring.data_clock):
                engine.set_pin(name, 1 - self._wiring.initial[name])
                engine.set_pin(name, self._wiring.initial[name])
            engine.run(engine.now_ps + 1_000_000)
        self._broken = [Counter(engine.violation_counts) for engine in (board, compiled)]
        return board, compiled

    def _difference(self, board: RtlEngine, compiled: RtlEngine, step: Step) -> list[str]:
        read = step.take(board), step.take(compiled)
        texts = []
        if read[0] != read[1]:
            place = next((n for n, (a, b) in enumerate(zip(*read, strict=False)) if a != b), 0)
            ours, theirs = (data[place : place + 8].hex(" ") for data in read)
            texts.append(f"bytes read from number {place} on: {ours} on the board, not {theirs}")
        return texts + self._state_difference(board, compiled)

    def _state_difference(self, board: RtlEngine, compiled: RtlEngine) -> list[str]:
        texts = []
        if board.now_ps != compiled.now_ps:
            texts.append(f"the time is {board.now_ps} ps on the board, not {compiled.now_ps} ps")
        ours, theirs = self._levels(board), self._levels(compiled)
        texts += [
            f"{pin} is {level:X} on the board, not {theirs[pin]:X}"
            for pin, level in ours.items()
            if level != theirs[pin]
        ]
        for name, memory in board.memories.items():
            wrong = np.flatnonzero(memory != compiled.memories[name])
            if len(wrong):
                place = int(wrong[0])
                texts.append(
                    f"{len(wrong)} bytes of {name} differ; at {place:X} it has {memory[place]:02X},"
                    f" not {compiled.memories[name][place]:02X}"
                )
        rules = [
            dict(engine.violation_counts - before)
            for engine, before in zip((board, compiled), self._broken, strict=True)
        ]
        if rules[0] != rules[1]:
            texts.append(f"broken rules are {rules[0]} on the board, not {rules[1]}")
        return texts

    def _levels(self, engine: RtlEngine) -> dict[str, int]:
        levels = {pin: engine.get_pin(pin) for pin in self._wiring.output_pins}
        for memory in self._wiring.memories:
            if not levels[memory["D_OE"]]:  # of clocks that were skipped
                del levels[memory["D_O"]]
        return levels

    # --- search -----------------------------------------------------------------------------------

    def _explain(self, number: int, name: str, texts: list[str]) -> Found:
        """Repeat the steps and find the first edge that differs."""
        pieces = [self._steps[number]]
        waves: deque[Wave] = deque(maxlen=WAVES)
        repeated = False
        while True:
            place, found, waves = self._repeat(number, pieces)
            if not found:
                break
            repeated, texts = True, found
            smaller = list(self._split(pieces[place]))
            if len(smaller) < 2:
                break
            pieces = [*pieces[:place], *smaller]
        return Found(name, texts, list(waves), repeated)

    def _repeat(self, number: int, pieces: Sequence[Step]) -> tuple[int, list[str], "deque[Wave]"]:
        board, compiled = self._start()
        waves: deque[Wave] = deque(maxlen=WAVES)
        try:
            for step in self._steps[:number]:
                for engine in (board, compiled):
                    step.take(engine)
            for place, piece in enumerate(pieces):
                texts = self._difference(board, compiled, piece)
                pins = [
                    {name: engine.get_pin(name) for name in self._wiring.widths}
                    for engine in (board, compiled)
                ]
                waves.append(Wave(compiled.now_ps, pins[0], pins[1]))
                if texts:
                    return place, texts, waves
            return 0, [], waves
        finally:
            board.close()
            compiled.close()

    def _split(self, step: Step) -> Iterator[Step]:
        """Smaller steps that do the same; one if it is a single edge."""
        if len(step.pins) + len(step.sources) > 1 or (step.pins and (step.span_ps or step.reads)):
            for pin in step.pins:
                yield Step(f"{pin[0]}={pin[1]:X}", (pin,))
            if step.sources:
                yield replace(step, pins=(), span_ps=0, reads=0)
            if step.span_ps or step.reads:
                yield replace(step, pins=(), sources=())
        elif step.span_ps > PERIOD_PS // 2:
            piece = max(PERIOD_PS // 2, -(-step.span_ps // _PIECES))
            for begin in range(0, step.span_ps, piece):
                yield replace(step, span_ps=min(piece, step.span_ps - begin))
        elif step.reads > 1:
            piece = -(-step.reads // _PIECES)
            for begin in range(0, step.reads, piece):
                yield replace(step, reads=min(piece, step.reads - begin))
        else:
            yield step
