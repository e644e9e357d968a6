"""The engine on the reference model of a board against the compiled engine: all the same."""

from fractions import Fraction

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.top import CubeStarTop
from tests.hdl.engines.board_events import BOARDS, random_events
from tests.tiers import quick, quick_ones

from ..cameras import Step, assert_same, assert_same_outputs, plain_camera, random_camera, read
from ..pair_board import SIDES, SIZES, pair_camera
from ..test_equivalence import random_step
from ..test_equivalence_pair import random_steps
from .boards import DirectChannel, bridge_board, direct, engine_on, model, noisy

SIZE = (16, 6)
BOARD = cubestar_wiring(CubeStarTop(*SIZE))


@pytest.mark.parametrize("name", quick_ones(BOARDS, "cubestar-shared"))
def test_pins_agree_over_random_events(name: str) -> None:
    board = BOARDS[name]
    wiring = board.wiring(False)
    events = random_events(board, wiring, np.random.default_rng(1), 15_000_000)
    assert_same_outputs([direct(wiring), make_engine(wiring)], events)


@pytest.mark.parametrize("seed", quick(range(10), 2))
def test_engines_agree_over_random_operation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = random_camera(rng, *SIZE)
    line_ps = int(camera.line_clocks * camera.period)
    skipping = bool(seed % 2)
    engines = [direct(BOARD, skipping=skipping), make_engine(BOARD, skipping=skipping)]
    assert_same(engines, lambda engine: engine.attach(camera), "attach")
    for _ in range(60):
        step = random_step(rng, camera, 2 * line_ps)
        assert_same(engines, step, step.__qualname__)


@pytest.mark.parametrize("seed", quick(range(4), 1))
def test_engine_on_the_gateware_of_a_board_agrees(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = random_camera(rng, *SIZE)
    line_ps = int(camera.line_clocks * camera.period)
    engines = [engine_on(DirectChannel(bridge_board(BOARD)), BOARD), make_engine(BOARD)]
    assert_same(engines, lambda engine: engine.attach(camera), "attach")
    for _ in range(30):
        step = random_step(rng, camera, 2 * line_ps)
        assert_same(engines, step, step.__qualname__)


def frame_steps(camera: object, span_ps: int, count: int) -> list[Step]:
    """A frame is stored, then ``count`` bytes are read."""
    return [
        lambda engine: engine.attach(camera),  # type: ignore[arg-type]
        lambda engine: engine.run(1_000_000),
        lambda engine: engine.set_pin("ENABLE", 1),
        lambda engine: engine.run(engine.now_ps + span_ps, ("ACK", 1)),
        lambda engine: engine.run(engine.now_ps + 3_000_000),
        lambda engine: engine.set_pin("ENABLE", 0),
        lambda engine: engine.set_pin("RNW", 1),
        lambda engine: engine.set_pin("ENABLE", 1),
        lambda engine: engine.run(engine.now_ps + 12_000),
        lambda engine: read(engine, count, Fraction(10**8, 131), 10**12),
        lambda engine: engine.set_pin("ENABLE", 0),
    ]


@pytest.mark.parametrize(
    "timing",
    [
        SramTiming(),
        SramTiming(write_pulse_ps=50_700),
        SramTiming(data_setup_ps=120_000),
        SramTiming(access_ps=800_000),
        SramTiming(output_enable_ps=20_000),
    ],
)
@pytest.mark.parametrize("period", quick([Fraction(10**12, 9_876_543), Fraction(100_000)], 1))
def test_slow_memories_break_the_same_rules(timing: SramTiming, period: Fraction) -> None:
    camera = plain_camera(*SIZE, period=period)
    engines = [direct(BOARD, timing), make_engine(BOARD, "compiled", timing)]
    for number, step in enumerate(frame_steps(camera, camera.end_ps, 150)):
        assert_same(engines, step, number)
    assert bool(engines[0].violations) == (timing != SramTiming())


def test_memory_without_supply_stores_nothing() -> None:
    camera = plain_camera(*SIZE)
    engines = [direct(BOARD), make_engine(BOARD, "compiled")]
    assert_same(engines, lambda engine: engine.power_memory("SRAM", False), "off")
    for number, step in enumerate(frame_steps(camera, camera.end_ps, 20)):
        assert_same(engines, step, number)
    assert not engines[0].sram.any()


@pytest.mark.parametrize("seed", quick(range(4), 1))
def test_pair_agrees_over_random_operation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    wiring = cubesense_wiring(CubeSensePair(SIZES[seed % len(SIZES)]))
    cameras = {side: pair_camera(rng, SIZES[seed % len(SIZES)]) for side in SIDES}
    engines = [direct(wiring), make_engine(wiring)]
    for side, camera in cameras.items():
        assert_same(engines, lambda e, c=camera, s=side: e.attach(c, s), side)  # type: ignore[misc]
    for step in random_steps(rng, cameras):
        assert_same(engines, step, step.__qualname__)


def test_whole_frame_is_few_requests_with_short_responses() -> None:
    """At full size, a few rows: each is a request, and the response says that it went as usual."""
    wiring = cubestar_wiring()
    channel = DirectChannel(model(wiring))
    engine = engine_on(channel, wiring)
    camera = plain_camera(1024, 6, 1, line_clocks=1344)
    before = engine.link.counters.frames, engine.link.counters.sent
    engine.attach(camera)
    engine.set_pin("ENABLE", 1)
    engine.run(camera.end_ps)
    counters = engine.link.counters
    assert (engine.sram[: 6 * 1024] == camera.images[0].ravel()).all()
    assert counters.frames - before[0] < 30
    assert counters.sent - before[1] < 6 * 1024 * 1.1


@pytest.mark.parametrize("frames", [1_000, pytest.param(4_000, marks=pytest.mark.slow)])
def test_line_that_damages_one_byte_in_a_hundred_loses_nothing(frames: int) -> None:
    camera = plain_camera(*SIZE, frames=frames // 8)
    channel = DirectChannel(model(BOARD))
    board = engine_on(channel, BOARD)
    channel.damage = noisy(0.01, 1)
    engines = [board, make_engine(BOARD)]
    assert_same(engines, lambda engine: engine.attach(camera), "attach")
    while (sent := board.link.counters.frames) < frames:
        for step in frame_steps(camera, 40_000_000, 150)[2:]:
            assert_same(engines, step, sent)
        assert_same(engines, lambda engine: engine.set_pin("RNW", 0), sent)
    assert engines[0].now_ps < camera.end_ps
    assert board.link.counters.repeated > frames / 50
    assert channel.board.executed < frames
