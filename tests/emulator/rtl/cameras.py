"""Cameras that play lists of segments, and engines that do the same steps side by side."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.contract import PinEvent, RtlEngine
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.emulator.rtl.wiring import Wiring

Image = NDArray[np.uint8]


@dataclass
class Segment:
    start_ps: int
    clocks: int
    vsync: int
    rows: int
    pixels: Callable[[], Image] | None


@dataclass
class ListCamera:
    """Plays blanking and images one after the other, then has no clock any more.

    The clock runs through: edge k of the whole stream is at floor(k * period).
    """

    period: Fraction
    line_clocks: int
    active_columns: int
    clocks: int = 0
    segments: list[Segment] = field(default_factory=list)
    images: list[Image] = field(default_factory=list)
    rendered: list[int] = field(default_factory=list)

    @property
    def end_ps(self) -> int:
        return int(self.clocks * self.period)

    def segment_at(self, time_ps: int) -> Segment | None:
        begun = [segment for segment in self.segments if segment.start_ps <= time_ps]
        return begun[-1] if begun and time_ps < self.end_ps else None

    def add_blank(self, clocks: int, vsync: int = 0) -> None:
        self._add(Segment(self.end_ps, clocks, vsync, 0, None))

    def add_image(self, image: Image, vsync: int = 1) -> None:
        number = len(self.images)
        self.images.append(image)

        def render() -> Image:
            self.rendered.append(number)
            return image

        self._add(Segment(self.end_ps, len(image) * self.line_clocks, vsync, len(image), render))

    def _add(self, segment: Segment) -> None:
        self.segments.append(segment)
        self.clocks += segment.clocks


def plain_camera(
    columns: int = 8,
    rows: int = 4,
    frames: int = 3,
    *,
    period: Fraction | int = 100_000,
    line_clocks: int | None = None,
    blank: int = 30,
    seed: int = 1,
) -> ListCamera:
    """Whole frames, with VSYNC low in the ``blank`` clocks before each."""
    rng = np.random.default_rng(seed)
    camera = ListCamera(Fraction(period), line_clocks or columns + 4, columns)
    for _ in range(frames):
        camera.add_blank(blank)
        camera.add_image(rng.integers(0, 256, (rows, columns), dtype=np.uint8))
    camera.add_blank(blank)
    return camera


def random_camera(rng: np.random.Generator, columns: int, rows: int) -> ListCamera:
    """Frames of all kinds: whole, cut, too large, without VSYNC between; lines too short or long.

    The period is seldom a whole number of picoseconds.
    """
    active = int(rng.choice([columns, columns, columns, columns - 1, columns + 2]))
    period = Fraction(10**12, int(rng.integers(9_000_000, 24_000_000)))
    camera = ListCamera(period, active + int(rng.integers(1, 30)), active)
    for _ in range(6):
        if rng.random() < 0.8:
            camera.add_blank(int(rng.integers(1, 60)), vsync=int(rng.random() < 0.3))
        height = rows if rng.random() < 0.6 else int(rng.integers(1, 2 * rows))
        image = rng.integers(0, 256, (height, active), dtype=np.uint8)
        camera.add_image(image, vsync=int(rng.random() < 0.95))
    camera.add_blank(20)
    return camera


Step = Callable[[RtlEngine], object]


def engines(wiring: Wiring, timing: SramTiming | None = None) -> list[RtlEngine]:
    """One of each sort; the last is the reference."""
    return [
        make_engine(wiring, kind, timing, skipping=skipping)
        for kind, skipping in product(("compiled", "python"), (True, False))
    ]


def state(engine: RtlEngine) -> dict[str, object]:
    """All that can be seen of an engine. Data that is not driven onto a bus is no data."""
    wiring = engine.wiring
    pins = (*wiring.output_pins, *wiring.camera_pins, *wiring.mcu_pins)
    levels = {name: engine.get_pin(name) for name in pins}
    for memory in wiring.memories:
        if not levels[memory["D_OE"]]:
            del levels[memory["D_O"]]
    for camera in wiring.cameras:
        # Rendered only for those who store.
        del levels[camera.data]
    return {
        **levels,
        "now": engine.now_ps,
        **{name: memory.tobytes() for name, memory in engine.memories.items()},
        "violations": engine.violations,
        "counts": engine.violation_counts,
    }


def assert_same(all_engines: Sequence[RtlEngine], step: Step, what: object) -> None:
    """Take a step with all engines; answers and states are the last one's."""
    *others, reference = all_engines
    expected = {"answer": step(reference), **state(reference)}
    for number, engine in enumerate(others):
        found = {"answer": step(engine), **state(engine)}
        differences = {k: (found[k], expected[k]) for k in expected if found.get(k) != expected[k]}
        assert not differences, (number, what)


def assert_same_outputs(all_engines: Sequence[RtlEngine], events: list[PinEvent]) -> np.ndarray:
    """Every output after every event, and the state in the end; the outputs."""
    *others, reference = all_engines
    expected = reference.apply(events)
    for engine in others:
        np.testing.assert_array_equal(engine.apply(events), expected)
        assert state(engine) == state(reference)
    return expected


def read(engine: RtlEngine, count: int, period: Fraction, reach: int) -> bytes:
    """Bytes of the transfer loop in the next ``reach`` ps."""
    out = np.zeros(count, np.uint8)
    made = engine.strobe_read(out, period, engine.now_ps + reach)
    return out[:made].tobytes()
