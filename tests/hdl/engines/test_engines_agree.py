"""Three engines on each top: Icarus Verilog, Amaranth's simulator, the compiled one.

Whole small frames and a microcontroller's work, pin by pin: after every event each output has
settled on the same level in all of them, and in the end the memories hold the same.
"""

import shutil
from collections.abc import Callable
from contextlib import closing
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.contract import PinEvent, RtlEngine
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.simulated import SimulatedEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.flow.generate import verilog_text
from tests.benchmarks.engines.verilated import VerilatedEngine, verilator_root
from tests.hdl.regression import FULL
from tests.tiers import quick, quick_ones

from .board_events import BOARDS, random_events
from .icarus_board import IcarusBoard, Played

pytestmark = [
    pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed"),
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
]

SEEDS = range(12 if FULL else 2)
END_PS = 120_000_000


class Case(NamedTuple):
    name: str
    wiring: Wiring
    icarus: IcarusBoard

    def events(self, seed: int, end_ps: int = END_PS) -> list[PinEvent]:
        rng = np.random.default_rng([seed, *self.name.encode()])
        return random_events(BOARDS[self.name], self.wiring, rng, end_ps)

    def some_events(self) -> list[PinEvent]:
        return self.events(0, END_PS // 3)


@pytest.fixture(scope="module", params=quick_ones(BOARDS, "cubesense-pair"))
def case(request, tmp_path_factory) -> Case:
    wiring = BOARDS[request.param].wiring(False)
    icarus = IcarusBoard(tmp_path_factory.mktemp("top"), wiring, verilog_text(wiring.component))
    return Case(request.param, wiring, icarus)


def play(engine: RtlEngine, events: list[PinEvent]) -> Played:
    with closing(engine):
        outputs = engine.apply(events)
        return Played(outputs, {name: m.tobytes() for name, m in engine.memories.items()})


def difference(wiring: Wiring, events: list[PinEvent], found: Played, expected: Played) -> str:
    """The first pin that differs, or the memories that do; empty when nothing does."""
    wrong = np.argwhere(found.outputs != expected.outputs)
    if len(wrong):
        row, pin = wrong[0]
        levels = f"{found.outputs[row, pin]}, not {expected.outputs[row, pin]}"
        return f"{wiring.output_pins[pin]} is {levels} after {events[row]}, event {row}"
    return ", ".join(name for name, m in found.memories.items() if m != expected.memories[name])


@pytest.mark.parametrize("seed", quick(SEEDS, 1))
def test_engines_agree_with_icarus_on_every_settled_pin(case, seed):
    events = case.events(seed)
    expected = case.icarus.play(events)
    assert expected.outputs.shape == (len(events), len(case.wiring.output_pins))
    engines: dict[str, Callable[[], RtlEngine]] = {
        "compiled": lambda: CompiledEngine(case.wiring),
        "amaranth": lambda: SimulatedEngine(case.wiring),
    }
    if FULL and verilator_root() is not None:
        engines["verilator"] = lambda: VerilatedEngine(case.wiring)
    for name, make in engines.items():
        assert not difference(case.wiring, events, play(make(), events), expected), name


def test_random_events_cover_acknowledges_memories_and_outputs(case):
    """Each acknowledge rises, each memory is written and read, each output moves."""
    outputs = np.concatenate(
        [play(CompiledEngine(case.wiring), case.events(s)).outputs for s in SEEDS]
    )
    pins = dict(zip(case.wiring.output_pins, outputs.T, strict=True))
    for memory in case.wiring.memories:
        pulses = np.flatnonzero(np.diff(pins[memory["WE_N"]]) == -1)
        assert len({*pins[memory["A"]][pulses + 1].tolist()}) > 20, memory
        assert (pins[memory["OE_N"]] == 0).any(), memory
    still = {name for name, levels in pins.items() if len(np.unique(levels)) == 1}
    assert still <= {case.wiring.contention}


@pytest.mark.slow
def test_a_fault_in_the_simulated_engine_and_in_icarus_is_found(case, tmp_path):
    """The same pins, and a picture one column less wide."""
    wiring, events = BOARDS[case.name].wiring(True), case.some_events()
    assert wiring.widths == case.wiring.widths
    expected = play(CompiledEngine(case.wiring), events)
    icarus = IcarusBoard(tmp_path, case.wiring, verilog_text(wiring.component))
    for found in (play(SimulatedEngine(wiring), events), icarus.play(events)):
        assert difference(case.wiring, events, found, expected)


def test_a_fault_in_the_compiled_engine_is_found(case):
    """A bit of the column counters turned over in every fifteenth write pulse."""
    events = case.some_events()
    expected = case.icarus.play(events)
    writes = [case.wiring.output_pins.index(memory["WE_N"]) for memory in case.wiring.memories]
    pulses = np.flatnonzero((expected.outputs[:, writes] == 0).any(axis=1))[::15]
    engine = CompiledEngine(case.wiring)
    counters = [name for name in engine.registers if name.endswith("writer.counter.column")]
    assert counters
    outputs = []
    for start, end in pairwise([0, *(pulses + 1).tolist(), len(events)]):
        outputs.append(engine.apply(events[start:end]))
        for counter in counters:
            engine.flip(counter, 0)
    memories = {name: memory.tobytes() for name, memory in engine.memories.items()}
    engine.close()
    assert difference(case.wiring, events, Played(np.concatenate(outputs), memories), expected)
