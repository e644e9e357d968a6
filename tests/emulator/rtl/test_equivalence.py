"""Compiled engine against Amaranth's simulator, skipping against not skipping: all the same."""

from fractions import Fraction
from functools import cache

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.contract import PinEvent
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.generate import rtlil_text
from tests.tiers import quick

from .cameras import (
    Step,
    assert_same,
    assert_same_outputs,
    engines,
    plain_camera,
    random_camera,
    read,
)

SIZES = [(8, 4), (5, 3)]


@cache
def wiring(size: tuple[int, int]) -> Wiring:
    return cubestar_wiring(CubeStarTop(*size))


BOARD = wiring(SIZES[0])
CAMERA_PINS, MCU_PINS, OUTPUT_PINS = BOARD.camera_pins, BOARD.mcu_pins, BOARD.output_pins
rtlil_text(BOARD.component)  # a design must be used, Amaranth says


def random_step(rng: np.random.Generator, camera: object, span_ps: int) -> Step:
    kind = rng.choice(
        ["run", "pins", "await", "read", "camera", "burst"], p=[0.25, 0.35, 0.2, 0.1, 0.05, 0.05]
    )
    wait = int(rng.integers(0, span_ps))
    match kind:
        case "run":
            return lambda engine: engine.run(engine.now_ps + wait)
        case "pins":
            pin = str(rng.choice(MCU_PINS, p=[0.45, 0.3, 0.15, 0.1]))
            level = int(rng.random() < (0.7 if pin == "ENABLE" else 0.35))
            return lambda engine: engine.set_pin(pin, level)
        case "await":
            return lambda engine: engine.run(engine.now_ps + 4 * wait, ("ACK", 1))
        case "read":
            count, period = int(rng.integers(1, 80)), Fraction(int(rng.integers(10, 2_000_000)), 7)
            period = max(period, Fraction(5_000))
            return lambda engine: read(engine, count, period, 4 * wait)
        case "camera":
            attached = camera if rng.random() < 0.7 else None
            return lambda engine: engine.attach(attached)
        case _:
            # Just a moment: near a write pulse, or at an edge itself.
            nudge = int(rng.integers(0, 40_000))
            return lambda engine: engine.run(engine.now_ps + nudge)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("seed", quick(range(15), 2))
def test_engines_agree_over_random_operation(size, seed):
    rng = np.random.default_rng([seed, *size])
    camera = random_camera(rng, *size)
    line_ps = int(camera.line_clocks * camera.period)
    all_engines = engines(wiring(size))
    assert_same(all_engines, lambda engine: engine.attach(camera), "attach")
    for _ in range(60):
        step = random_step(rng, camera, 2 * line_ps)
        assert_same(all_engines, step, step.__qualname__)


@pytest.mark.parametrize("seed", quick(range(16), 2))
def test_engines_agree_on_captures_and_reads(seed):
    """Long enough for whole frames to be stored, in either bank, with ENABLE at any moment."""
    size = SIZES[seed % len(SIZES)]
    rng = np.random.default_rng(seed)
    camera = random_camera(rng, *size)
    all_engines = engines(wiring(size))
    wait, bank, late = int(rng.integers(0, 40 * camera.period)), seed & 1, 3_000_000
    steps: list[Step] = [
        lambda engine: engine.attach(camera),
        lambda engine: engine.run(wait),
        lambda engine: engine.set_pin("BANK", bank),
        lambda engine: engine.set_pin("ENABLE", 1),
        lambda engine: engine.run(camera.end_ps, ("ACK", 1)),
        lambda engine: engine.run(engine.now_ps + late),
        lambda engine: engine.set_pin("RNW", 1),
        lambda engine: engine.run(engine.now_ps + 12_000),
        lambda engine: read(engine, 2 * size[0] * size[1], Fraction(10**6, 3), 10**12),
        lambda engine: engine.set_pin("ENABLE", 0),
    ]
    for number, step in enumerate(steps):
        assert_same(all_engines, step, number)


def random_events(rng: np.random.Generator, count: int) -> list[PinEvent]:
    """Levels on any pin, at most one event at an instant; ENABLE and RNW settle now and then."""
    events, time_ps = [], 0
    pins = (*CAMERA_PINS, *MCU_PINS)
    weights = np.array([10, 3, 1, 0.15, 0.1, 0.1, 0.1, 8])
    level = dict.fromkeys(pins, 0)
    for _ in range(count):
        time_ps += int(rng.integers(1, 20_000))
        pin = str(rng.choice(pins, p=weights / weights.sum()))
        if pin == "PIXDATA":
            level[pin] = int(rng.integers(0, 256))
        elif pin in ("PIXCLK", "DCLK"):
            level[pin] ^= 1
        else:
            mostly_high = {"ENABLE": 0.85, "HSYNC": 0.75, "VSYNC": 0.9}
            level[pin] = int(rng.random() < mostly_high.get(pin, 0.4))
        events.append(PinEvent(time_ps, pin, level[pin]))
    return events


@pytest.mark.parametrize("seed", quick(range(6), 1))
def test_engines_agree_on_random_pin_events(seed):
    all_engines = engines(wiring(SIZES[seed % len(SIZES)]))
    outputs = assert_same_outputs(all_engines, random_events(np.random.default_rng(seed), 1500))
    assert len(np.unique(outputs[:, OUTPUT_PINS.index("SRAM_A")])) > 10
    assert all_engines[-1].violations


def test_compiled_engine_skips_an_hour_of_blanking():
    """An hour of blanking costs nothing, and the frame behind it is stored all the same."""
    camera = plain_camera(blank=36_000_000_000)
    engine = make_engine(BOARD, "compiled")
    engine.attach(camera)
    engine.set_pin("ENABLE", 1)
    start = camera.segments[1].start_ps
    assert engine.run(2 * start, ("ACK", 1)) == start + (3 * 12 + 8) * 100_000
    assert (engine.sram[:32] == camera.images[0].ravel()).all()


def test_memory_timing_limits_reach_both_engines():
    slow = SramTiming(write_pulse_ps=60_000, data_setup_ps=110_000)
    counts = []
    for kind in ("compiled", "python"):
        engine = make_engine(BOARD, kind, slow)
        engine.attach(plain_camera(frames=1))
        engine.set_pin("ENABLE", 1)
        engine.run(10**10)
        counts.append(dict(engine.violation_counts))
    assert counts == [{"short-write-pulse": 32, "data-setup": 32}] * 2
