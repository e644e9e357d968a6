"""CubeStar's compiled times: page, data file, loops, and what a compiler repeats."""

import shutil

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.compiled.build import (
    COMPILER,
    LEVELS,
    PRECISIONS,
    compiler_version,
)
from cubestack.emulator.boards.cubestar.compiled.machine import Timing, start_program
from cubestack.emulator.boards.monitor import peek
from cubestack.emulator.iss.insight.symbols import Symbols
from tests.compiled_costs import cubestar_times as times
from tests.compiled_costs import pages
from tests.tiers import quick

CLOCK_PIN = 8  #: as in cubestar_times.c

needs_compiler = pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"no {COMPILER}")


@pytest.mark.parametrize("name", ["both", "processing", "transfer"])
def test_page_has_the_table_of_the_data_file(name: str) -> None:
    assert pages.has(times.PAGE, times.tables(times.recorded())[name])


def test_data_file_has_every_build_on_every_memory_once() -> None:
    found, memories = times.recorded(), {str(one) for one in times.MEMORIES}
    builds = {f"-{level} {precision}" for level in LEVELS for precision in PRECISIONS}
    pairs = [(one.build, one.memory) for one in found.processing]
    assert len(pairs) == len(set(pairs)) == len(builds) * len(memories)
    assert ({build for build, _ in pairs}, {memory for _, memory in pairs}) == (builds, memories)
    loops = [(one.level, one.memory) for one in found.transfers]
    assert len(loops) == len(set(loops)) == len(LEVELS) * len(memories)
    assert all(tuple(one.ms) == times.LOOPS for one in found.transfers)


def test_data_file_is_of_the_present_sources() -> None:
    hint = "run python -m tests.compiled_costs.cubestar_times --write"
    assert times.recorded().sources == times.sources(), hint


def test_near_both_times_are_only_builds_without_optimisation_and_cache() -> None:
    """As the page says of the wait states that the part needs at 48 MHz."""
    found = [one for one, _ in times.both(times.recorded()) if one.memory.startswith("2 ")]
    assert found
    assert all(one.build.startswith("-O0 ") and "no cache" in one.memory for one in found)
    assert all(one.attitude_ms < times.ATTITUDE_MS for one in found)


@pytest.mark.parametrize(("ms", "near"), [(288, True), (287.9, False), (351.9, True), (353, False)])
def test_near_is_a_tenth(ms: float, near: bool) -> None:
    assert times.is_near(ms, 320) is near


@needs_compiler
@pytest.mark.parametrize("level", quick(["O0", "O2"], 1))
def test_each_loop_stores_each_byte_once_and_leaves_the_clock_low(level: str) -> None:
    calls = start_program(times.program(level, "own"), Timing())
    memory = calls.machine.external
    for loop in times.LOOPS:
        memory[:] = 0xEE
        calls.call(loop, 16)
        stored = np.flatnonzero(memory != 0xEE)
        second = 1024 if loop == "rows" else 8
        assert stored.tolist() == [*range(8), *range(second, second + 8)], loop
        (output,) = peek(calls.machine, Symbols(None), "GPIO.PD_DOUT")
        assert not output.value & 1 << CLOCK_PIN, loop


@needs_compiler
@pytest.mark.slow
def test_compiler_and_simulator_repeat_the_data_file() -> None:
    found = times.recorded()
    if found.compiler != compiler_version():
        pytest.skip("recorded of another compiler")
    memory = Timing(cache=False, bus=times.BUSES[1])
    ((processing, transfer),) = times.measured("O0", "double", times.image(), [memory])
    assert processing in found.processing
    assert transfer in found.transfers
