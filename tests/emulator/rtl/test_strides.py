"""Many clocks at once, beside the same clocks one by one: nothing may tell them apart."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from functools import cache, partial
from itertools import product

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar.wiring import (
    cubestar_double_wiring,
    cubestar_shared_wiring,
    cubestar_wiring,
)
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.cubesense.fpga import READ_OUTS
from cubestack.hdl.cubesense.pair import CubeSensePair
from tests.emulator.rtl.cameras import ListCamera, assert_same, read
from tests.tiers import quick

from .pair_board import ENABLES, SIDES

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

PERIOD = Fraction(10**12, 12_300_000)
COLUMNS, ROWS = 1024, 512
own = cache(cubestar_wiring)
BOARDS = (own, cache(cubestar_shared_wiring), cache(cubestar_double_wiring))

#: Each is one that a stride would break: for those it must not be made.
SLOW_PARTS = (
    SramTiming(write_pulse_ps=50_000),
    SramTiming(data_setup_ps=90_000),
    SramTiming(access_ps=800_000),
)


@contextmanager
def both(
    wiring: Wiring, timing: SramTiming | None = None, *, exact: bool = True
) -> Iterator[list[CompiledEngine]]:
    """The engine, and the exact one, or else the same without strides."""
    engines = [CompiledEngine(wiring, timing, skipping=skips) for skips in (True, not exact)]
    engines[1].use_strides(False)
    yield engines
    for engine in engines:
        engine.close()


def camera(rng: np.random.Generator, rows: int, columns: int = COLUMNS) -> ListCamera:
    """A part of a picture that is joined in the middle, then a whole one or less."""
    line_clocks = columns + int(rng.integers(3, 40))
    found = ListCamera(PERIOD, line_clocks, columns)
    found.add_image(rng.integers(0, 256, (3, columns), np.uint8))
    found.add_blank(200)
    found.add_image(rng.integers(0, 256, (rows, columns), np.uint8))
    found.add_blank(300)
    return found


def step(engines: list[CompiledEngine], act: Callable[[RtlEngine], object], what: object) -> None:
    assert_same(engines, act, what)
    assert engines[0].state() == engines[1].state(), what


@pytest.mark.parametrize(("board", "seed"), quick(product(BOARDS, range(4)), 5))
def test_both_engines_store_the_same_image(board: Callable[[], Wiring], seed: int) -> None:
    rng = np.random.default_rng(seed)
    # Rows of the picture's length, too long, too short.
    columns = (COLUMNS, COLUMNS, COLUMNS + 9, COLUMNS - 200)[seed]
    source = camera(rng, ROWS + 1 if seed else ROWS, columns)
    with both(board()) as engines:
        registers = engines[0].registers
        for engine in engines:
            engine.attach(source)
            engine.set_pin("ENABLE", 1)
        times = np.sort(rng.integers(0, source.end_ps, 60))
        for number, time_ps in enumerate(times):
            step(engines, lambda engine, t=int(time_ps): engine.run(t), number)
            if number % 10 == 9:
                name = list(registers)[int(rng.integers(len(registers)))]
                bit = int(rng.integers(registers[name]))
                step(engines, lambda engine, n=name, b=bit: engine.flip(n, b), (name, bit))
        assert engines[0].stride_clocks > 10 * COLUMNS
        assert engines[1].stride_clocks == 0


def pair_camera(rng: np.random.Generator, gateware: str) -> ListCamera:
    """A part of a frame, then whole ones with bright pixels anywhere, alone and in runs."""
    size = READ_OUTS[gateware]
    columns = size.columns - int(rng.integers(-9, 10)) * int(rng.random() < 0.5)
    found = ListCamera(Fraction(10**12, 13_500_000), columns + int(rng.integers(1, 230)), columns)
    for rows in (int(rng.integers(2, 30)), size.rows - int(rng.random() < 0.3), size.rows):
        image = rng.integers(0, 200, (rows, columns), np.uint8)
        for y, x in zip(rng.integers(0, rows, 20), rng.integers(0, columns, 20), strict=True):
            image[y, x : x + int(rng.integers(1, 9))] = int(rng.integers(199, 256))
        found.add_image(image)
        found.add_blank(int(rng.integers(size.frame_gap - 3, size.frame_gap + 9)))
    return found


@pytest.mark.parametrize(
    ("gateware", "seed"), quick([(name, seed) for name in READ_OUTS for seed in range(6)], 2)
)
def test_both_engines_of_the_pair_store_the_same_images(gateware: str, seed: int) -> None:
    """One half or both. The exact engine also runs cameras whose images are stored."""
    rng = np.random.default_rng(seed)
    wiring = cubesense_wiring(CubeSensePair(READ_OUTS[gateware], mcu_addressing=seed > 3))
    sources = {side: pair_camera(rng, gateware) for side in SIDES}
    with both(wiring, exact=False) as engines:
        registers = engines[0].registers
        for engine in engines:
            for side, source in sources.items():
                engine.attach(source, side)
        end_ps = max(source.end_ps for source in sources.values())
        halves = (ENABLES[:1], ENABLES[1:], ENABLES)[seed % 3]
        for name in halves:
            step(engines, lambda engine, n=name: engine.set_pin(n, 0), name)
        for number, time_ps in enumerate(np.sort(rng.integers(0, end_ps, 50))):
            step(engines, lambda engine, t=int(time_ps): engine.run(t), number)
            if number % 10 == 9:
                name = list(registers)[int(rng.integers(len(registers)))]
                bit = int(rng.integers(registers[name]))
                step(engines, lambda engine, n=name, b=bit: engine.flip(n, b), (name, bit))
        step(engines, lambda engine: engine.run(end_ps), "end")
        assert engines[1].stride_clocks == 0
        # While both cameras' clocks run there are none.
        assert (engines[0].stride_clocks > 100_000) or halves == ENABLES


@pytest.mark.parametrize("seed", quick(range(3), 1))
def test_both_engines_read_the_same_bytes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    with both(own()) as engines:
        engines[0].sram[:] = engines[1].sram[:] = rng.integers(0, 256, 2 * COLUMNS * ROWS)
        for engine in engines:
            for pin in ("RNW", "BANK", "ENABLE"):
                engine.set_pin(pin, 1)
        for number in range(40):
            count = int(rng.integers(1, 4000))
            period = Fraction(int(rng.integers(30_000, 900_000)), int(rng.integers(1, 4)))
            reach_ps = int(count * period * Fraction(9, 10))
            step(engines, partial(read, count=count, period=period, reach=reach_ps), number)
            if number % 8 == 7:
                register = ("reader.counter.column", "reader.counter.row")[number // 8 % 2]
                later_ps = engines[0].now_ps + int(rng.integers(10**9))
                for engine in engines:
                    engine.flip(register, number // 8, later_ps)
        assert engines[0].stride_clocks > 10_000


@pytest.mark.parametrize("timing", quick([None, SLOW_PARTS[-1]], 1))
def test_single_edges_of_the_data_clock_read_the_same_bytes(timing: SramTiming | None) -> None:
    rng = np.random.default_rng(2)
    wiring = own()
    seen = (*wiring.output_pins, *wiring.mcu_pins)
    with both(wiring, timing) as engines:
        engines[0].sram[:] = engines[1].sram[:] = rng.integers(0, 256, 2 * COLUMNS * ROWS)

        def set_pin(name: str, level: int, later_ps: int) -> None:
            for engine in engines:
                engine.run(engine.now_ps + later_ps)
                engine.set_pin(name, level)
            ours, reference = (
                ([(pin, engine.get_pin(pin)) for pin in seen], engine.state()) for engine in engines
            )
            assert ours == reference, (name, level, engines[0].now_ps)

        for name, level in (("ENABLE", 0), ("RNW", 1), ("ENABLE", 1)):
            set_pin(name, level, 10**6)
        for number in range(5 * COLUMNS):
            high = number % 2 == 0 if rng.random() < 0.98 else rng.random() < 0.5
            set_pin(wiring.data_clock, int(high), int(rng.integers(1, 900_000)))
            if number < COLUMNS and rng.random() < 0.01:  # later to the row's end and beyond
                name = ("ENABLE", "RNW", "BANK")[int(rng.integers(3))]
                set_pin(name, 0, 10**6)
                set_pin(name, 1, 10**6)
        step(engines, lambda engine: engine.run(engine.now_ps + 10**6), "end")
        assert engines[0].stride_clocks > (COLUMNS if timing is None else 100)
        assert engines[1].stride_clocks == 0


@pytest.mark.parametrize("timing", SLOW_PARTS)
def test_both_engines_report_the_same_violations_of_a_slow_memory(timing: SramTiming) -> None:
    rng = np.random.default_rng(1)
    source = camera(rng, 12)
    with both(own(), timing) as engines:
        for engine in engines:
            engine.attach(source)
            engine.set_pin("ENABLE", 1)
        step(engines, lambda engine: engine.run(source.end_ps), "stored")
        for engine in engines:
            engine.set_pin("ENABLE", 0)
            engine.set_pin("RNW", 1)
            engine.set_pin("ENABLE", 1)
        step(engines, lambda engine: read(engine, 3000, Fraction(770_000), 10**12), "read")
        assert engines[0].violation_counts


def test_strides_can_be_switched_off() -> None:
    source = camera(np.random.default_rng(0), 4)
    with both(own()) as (engine, _):
        engine.use_strides(False)
        engine.attach(source)
        engine.set_pin("ENABLE", 1)
        engine.run(source.end_ps // 2)
        assert engine.stride_clocks == 0
        engine.use_strides(True)
        engine.run(source.end_ps)
        assert engine.stride_clocks > COLUMNS
