"""One engine beside the other: the same step on all of them, then the same state."""

from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np

from cubestack.emulator.rtl.contract import PinEvent, RtlEngine
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.emulator.rtl.wiring import Wiring

Step = Callable[[RtlEngine], object]


def engines(wiring: Wiring, timing: SramTiming | None = None) -> list[RtlEngine]:
    """One of each sort; the last is the reference."""
    return [
        make_engine(wiring, kind, timing, skipping=skipping)
        for kind, skipping in (
            ("compiled", True),
            ("compiled", False),
            ("python", True),
            ("python", False),
        )
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
