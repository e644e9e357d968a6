"""The reference algorithms as compiled code on the simulated part: same bits, and their cycles."""

import shutil
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue
from cubestack.emulator.boards.cubestar.compiled import picture
from cubestack.emulator.boards.cubestar.compiled.build import (
    COMPILER,
    Build,
    compile_program,
    compiler_version,
    rewrite_source,
)
from cubestack.emulator.boards.cubestar.compiled.machine import (
    Timing,
    operation_cycles,
    start_program,
)
from cubestack.emulator.boards.monitor import peek
from cubestack.emulator.iss.calls import CallError, Calls
from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3, load_measurements
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.cubestar.costs import generated
from tests.tiers import quick, quick_ones

from .....firmware_model.cubestar.sky import take

needs_compiler = pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"no {COMPILER}")


@cache
def image(level: str) -> Image:
    """The program, compiled once for each level."""
    return compile_program(Build(level), generated())


@pytest.fixture(scope="module")
def shot() -> NDArray[np.uint8]:
    pose = Rotation.from_euler("zxz", [40, 65, -110], degrees=True)
    return take(onboard_catalogue(), pose).picture


@pytest.fixture(scope="module")
def fast() -> Calls:
    return start_program(image("O2"), Timing())


@needs_compiler
@pytest.mark.parametrize("level", quick_ones(["O0", "O2", "Os"], "O2"))
def test_compiled_attitude_is_identical_to_the_bit(level: str, shot: NDArray[np.uint8]) -> None:
    calls = start_program(image(level), Timing())
    expected = picture.run_model(shot, onboard_catalogue(), Meter(CORTEX_M3))
    found = picture.run(calls, shot)
    assert (found.stars, found.quaternion) == (expected.stars, expected.quaternion)
    assert found.cycles.keys() == expected.cycles.keys()
    assert 0.5 < sum(found.cycles.values()) / sum(expected.cycles.values()) < 3


@pytest.fixture
def recorded_compiler() -> None:
    """Another one makes other code: `cubestack costs measure` is for that."""
    compiler, _ = load_measurements()
    if compiler != compiler_version():
        pytest.skip(f"recorded of {compiler}")


@needs_compiler
@pytest.mark.usefixtures("recorded_compiler")
def test_operation_costs_match_the_record(fast: Calls) -> None:
    _, recorded = load_measurements()
    (of_this_build,) = (
        one for one in recorded if (one.build, one.timing) == (str(Build("O2")), str(Timing()))
    )
    found = operation_cycles(fast)
    assert found == pytest.approx(of_this_build.operations, rel=0.1, abs=2)


@needs_compiler
def test_waits_of_the_memories_cost_cycles(shot: NDArray[np.uint8]) -> None:
    cycles = [
        sum(picture.run(start_program(image("O2"), timing), shot).cycles.values())
        for timing in (
            Timing(flash_waits=0),
            Timing(),
            Timing(cache=False),
            Timing(cache=False, bus=(3, 3, 15, 3)),
        )
    ]
    assert cycles == sorted(cycles)
    assert cycles[-1] > 1.5 * cycles[0]


@needs_compiler
def test_reports_faulting_and_unknown_calls(fast: Calls) -> None:
    with pytest.raises(KeyError):
        fast.call("no_such_function")
    with pytest.raises(CallError, match="fault"):
        fast.call("read_words", 1, 0x6000_0000)


@pytest.mark.slow
@needs_compiler
def test_fault_does_not_consume_stack_of_later_calls() -> None:
    calls = start_program(image("O2"), Timing())
    calls.call("read_words", 1, 0)
    before = calls.machine.register("sp")
    with pytest.raises(CallError):
        calls.call("read_words", 1, 0x6000_0000)
    calls.call("read_words", 1, 0)
    assert calls.machine.register("sp") == before


def test_sources_are_rewritten_for_each_float_precision() -> None:
    line = "float y = 0.5f * sqrtf(x) + 0x1.8p+1f; // pair_2.0f"
    assert rewrite_source(line, "own") == line
    assert rewrite_source("float y = 0.5f * sqrtf(x);", "literals") == "float y = 0.5 * sqrt(x);"
    assert rewrite_source("float y = 1e-3f;", "double") == "double y = 1e-3f;"
    stored = "typedef float stored_float;\n"
    assert rewrite_source(stored, "double") == stored
    with pytest.raises(ValueError, match="not O9"):
        Build("O9")


@needs_compiler
@pytest.mark.usefixtures("recorded_compiler")
@pytest.mark.parametrize("seed", [1, 2])
def test_python_charges_match_the_compiled_program_per_phase(fast: Calls, seed: int) -> None:
    """All in all within 8 %, the longer phases within 15 %, those below 1.5 ms within 40 %.

    Short phases run once through code that the flash's cache does not have yet.
    """
    pose = Rotation.random(rng=np.random.default_rng(seed))
    taken = take(onboard_catalogue(), pose).picture
    charges = picture.run_model(taken, onboard_catalogue(), Meter(CORTEX_M3)).cycles
    cycles = picture.run(fast, taken).cycles
    assert sum(charges.values()) == pytest.approx(sum(cycles.values()), rel=0.08)
    for phase, count in cycles.items():
        ms = count / 48_000
        if ms > 0.05:
            tolerance = 0.15 if ms > 1.5 else 0.4
            assert charges[phase] == pytest.approx(count, rel=tolerance), phase


@needs_compiler
@pytest.mark.parametrize(
    ("timing", "mode"),
    quick(
        [
            (Timing(1, False, False, (3, 3, 63, 0)), 1),
            (Timing(0, True, False, (0, 1, 2, 3)), 0),
            (Timing(2, True, True, (1, 0, 5, 2)), 4),
        ],
        1,
    ),
)
def test_timing_is_read_from_the_processor_registers(timing: Timing, mode: int) -> None:
    """By the fields' names: MSC, EBI and CMU of the EFM32GG Reference Manual."""
    machine = start_program(image("O2"), timing).machine

    def fields(what: str) -> dict[str, int]:
        (found,) = peek(machine, Symbols(None), what)
        return found.fields

    control = fields("MSC.READCTRL")
    assert (control["MODE"], control["IFCDIS"]) == (mode, int(not timing.cache))
    assert control["PREFETCH"] == timing.prefetch
    address, setup, strobe, hold = timing.bus
    assert fields("EBI.ADDRTIMING")["ADDRSETUP"] == address
    for way, name in (("RD", "RDTIMING"), ("WR", "WRTIMING")):
        phases = fields(f"EBI.{name}")
        assert (phases[f"{way}SETUP"], phases[f"{way}STRB"]) == (setup, strobe)
        assert phases[f"{way}HOLD"] == hold
    bus, route = fields("EBI.CTRL"), fields("EBI.ROUTE")
    assert (bus["MODE"], bus["BANK0EN"]) == (2, 1)  # D8A24ALE
    assert (route["EBIPEN"], route["CS0PEN"], route["ALEPEN"]) == (1, 1, 1)
    assert machine.write(0x8000_0005, 0xA5, 1)
    assert machine.read(0x8000_0005, 1) == 0xA5


BUSES = ((4, 0, 0, 0), (0, 4, 0, 0), (0, 0, 64, 0), (0, 0, 0, 4), (-1, 0, 0, 0))


@pytest.mark.parametrize(
    "changes", [*({"flash_waits": n} for n in (3, -1)), *({"bus": bus} for bus in BUSES)]
)
def test_rejects_timings_that_registers_cannot_hold(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="flash waits are 0 to 2, waits of the bus 0 to 3, 3, 63"):
        Timing(**changes)
    most = Timing(0, False, True, (3, 3, 63, 3))
    assert str(most) == "0 flash waits, no cache, prefetch, bus 3-3-63-3"
