"""CubeSense's pair: compiled engine against Amaranth's simulator, skipping against not skipping."""

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.contract import PinEvent
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.firmware_model.interface.cubesense.fpga import COMMANDS
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.top import CubeStarTop
from tests.tiers import quick

from .cameras import ListCamera, Step, assert_same, assert_same_outputs, engines, plain_camera, read
from .pair_board import SIDES, SIZES, Script, pair_camera, stores

WIRINGS = [cubesense_wiring(CubeSensePair(size)) for size in SIZES]
SUN, NADIR = SIDES

#: Levels of SHIFT, EDGE, RNW, SUNEN and NADEN in which bytes are read.
READING = [
    (c.shift, c.edge, c.rnw, c.sunen, c.naden)
    for c in COMMANDS
    if c.edge or (c.rnw and not c.shift)
]


def pin_step(name: str, level: int) -> Step:
    return lambda engine: engine.set_pin(name, level)


def run_step(ps: int) -> Step:
    return lambda engine: engine.run(engine.now_ps + ps)


def random_command(rng: np.random.Generator) -> Iterator[Step]:
    """Through standby to any levels of the control lines: mostly a way to store."""
    script = Script(rng)
    levels = tuple(int(level) for level in rng.integers(0, 2, 5))
    if rng.random() < 0.85:
        levels = stores()[rng.integers(5)][0]
    script.command(*levels)
    before = 0
    for time_ps, name, level in script.commands:
        yield run_step(time_ps - before)
        yield pin_step(name, level)
        before = time_ps


def random_steps(rng: np.random.Generator, cameras: dict[str, ListCamera]) -> Iterator[Step]:
    wait = int(rng.integers(0, 15_000_000))
    nudge = int(rng.integers(0, 60_000))
    side, other = rng.permutation(SIDES)
    ack = str(rng.choice(["SUNACK", "NADACK"]))
    match rng.choice(["command", "run", "nudge", "await", "read", "camera", "power"], p=PARTS):
        case "command":
            yield from random_command(rng)
        case "run":
            yield run_step(wait)
        case "nudge":
            yield run_step(nudge)
        case "await":
            yield lambda engine: engine.run(engine.now_ps + 2 * wait, (ack, 1))
        case "read":
            count, period = int(rng.integers(1, 60)), Fraction(int(rng.integers(35_000, 10**6)), 7)
            yield lambda engine: read(engine, count, period, 10 * wait)
        case "camera":
            attached = cameras[side] if rng.random() < 0.7 else None
            yield lambda engine: engine.attach(attached, side)
        case "power":
            on = bool(rng.random() < 0.7)
            yield lambda engine: engine.power_memory(other, on)


PARTS = [0.2, 0.2, 0.2, 0.25, 0.08, 0.04, 0.03]


@pytest.mark.parametrize("seed", quick(range(12), 1))
def test_pair_engines_agree_over_random_operation(seed):
    rng = np.random.default_rng(seed)
    number = seed % len(SIZES)
    cameras = {side: pair_camera(rng, SIZES[number], frames=40) for side in SIDES}
    all_engines = engines(WIRINGS[number])
    for side, camera in cameras.items():
        assert_same(all_engines, lambda engine, c=camera, s=side: engine.attach(c, s), "attach")
    for part in range(12):
        for step in random_steps(rng, cameras):
            assert_same(all_engines, step, (part, step.__qualname__))


def random_events(rng: np.random.Generator, count: int) -> list[PinEvent]:
    """Clocks and lines of both cameras and CLK at random, in one command after the other."""
    script, levels = Script(rng), dict.fromkeys((*WIRINGS[0].camera_pins, "CLK"), 0)
    commands = [*(command for command, _ in stores())] * 3 + READING
    while len(script.commands) < count:
        script.command(*commands[rng.integers(len(commands))])
        for _ in range(int(rng.integers(100, 1500))):
            camera, kind = rng.choice(["SUN", "NAD"]), rng.random()
            pins = {0.1: "CLK", 0.25: f"{camera}_Y", 0.28: f"{camera}_HREF", 1: f"{camera}_PCLK"}
            pin = next(name for below, name in pins.items() if kind < below)
            levels[pin] = int(rng.integers(0, 256)) if pin.endswith("Y") else 1 - levels[pin]
            script.do(pin, levels[pin])
    return [PinEvent(*command) for command in script.commands]


@pytest.mark.parametrize("seed", quick(range(3), 1))
def test_pair_engines_agree_on_random_pin_events(seed):
    """With limits so wide that many writes and reads break them."""
    wiring = WIRINGS[seed % len(WIRINGS)]
    all_engines = engines(wiring, SramTiming(30_000, 20_000, 20_000, 30_000, 60_000))
    outputs = assert_same_outputs(all_engines, random_events(np.random.default_rng(seed), 4000))
    addresses = [wiring.output_pins.index(memory["A"]) for memory in wiring.memories]
    assert len(np.unique(outputs[:, addresses])) > 10
    assert len(all_engines[-1].violation_counts) >= 3


@pytest.mark.parametrize("kind", ["compiled", "python"])
def test_first_camera_acknowledges_first_at_equal_times(kind):
    """Told by the violations: with these limits every write is one."""
    size = SIZES[0]
    engine = make_engine(WIRINGS[0], kind, SramTiming(write_pulse_ps=10**9))
    for side in SIDES[::-1]:
        engine.attach(plain_camera(size.columns, size.rows, blank=20), side)
    for pin in ("SUNEN", "NADEN"):
        engine.set_pin(pin, 0)
    engine.run(10**9, ("SUNACK", 1))
    # Both at the same time, and the engine stopped between the two.
    assert [engine.get_pin(pin) for pin in ("SUNACK", "NADACK")] == [1, 0]
    engine.run(engine.now_ps)
    assert engine.get_pin("NADACK") == 1
    assert [v.where for v in engine.violations] == [*SIDES] * (len(engine.violations) // 2)
    assert engine.violation_counts == {"short-write-pulse": 2 * size.pixels}


@pytest.mark.parametrize("kind", ["compiled", "python"])
def test_wire_contention_is_recorded_each_time(kind):
    """The designs never do that, so another output replaces CONTENTION."""
    wiring = replace(cubestar_wiring(CubeStarTop(3, 2)), contention="SRAM_CE_N")
    engine = make_engine(wiring, kind)
    for time_ps in (1_000, 2_000):
        engine.set_pin("ENABLE", 1)
        engine.run(time_ps)
        engine.set_pin("ENABLE", 0)
    assert [(v.kind, v.time_ps, v.where, v.detail) for v in engine.violations] == [
        ("wire-contention", time_ps, "wires", "two FPGAs drive the same wires, CONTENTION is 1")
        for time_ps in (0, 1_000, 2_000)
    ]


def test_compiled_engine_skips_blanking_and_unused_cameras():
    """An hour between frames costs nothing, nor does a camera that nobody stores, nor a scan."""
    size = SIZES[0]
    slow = plain_camera(size.columns, size.rows, blank=36_000_000_000)
    quick = plain_camera(size.columns, size.rows, blank=36_000_000_000, seed=2)
    engine = make_engine(WIRINGS[0], "compiled")
    engine.attach(slow, SUN)
    engine.attach(quick, NADIR)
    engine.set_pin("SUNEN", 0)
    start = slow.segments[1].start_ps
    acknowledged = engine.run(2 * start, ("SUNACK", 1))
    assert acknowledged == start + ((size.rows - 1) * slow.line_clocks + size.columns) * 100_000
    engine.set_pin("SUNEN", 1)
    engine.set_pin("RNW", 1)
    engine.set_pin("SUNEN", 0)
    picture = read(engine, size.pixels, Fraction(10**10), 10**13)
    assert picture == slow.images[0].tobytes()
    assert quick.rendered == []


def test_skipped_clocks_are_run_if_the_other_camera_stops_the_run():
    """The nadir's gap is skipped when the sun acknowledges in it, and then cut by standby."""
    size = SIZES[0]
    sun = plain_camera(size.columns, size.rows, frames=1, blank=20)
    nadir = plain_camera(size.columns, size.rows, frames=2, blank=400, seed=2)
    all_engines = engines(WIRINGS[0])
    steps: list[Step] = [
        lambda engine: engine.attach(sun, SUN),
        lambda engine: engine.attach(nadir, NADIR),
        pin_step("SUNEN", 0),
        pin_step("NADEN", 0),
        lambda engine: engine.run(10**9, ("SUNACK", 1)),
        pin_step("NADEN", 1),
        pin_step("NADEN", 0),
        lambda engine: engine.run(10**9, ("NADACK", 1)),
    ]
    for number, step in enumerate(steps):
        assert_same(all_engines, step, number)
    assert all_engines[0].get_pin("NADACK") == 1
