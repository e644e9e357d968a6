"""Builds designs and runs cocotb modules on them; keeps the waveform of a test that fails."""

import json
import os
import re
import shutil
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from amaranth.lib.wiring import Component
from cocotb_tools.runner import Runner

from cubestack.hdl.contract import simulator
from cubestack.hdl.flow.generate import verilog_text
from tests.hdl import regression
from tests.hdl.coverage import points
from tests.hdl.progress import Progress
from tests.hdl.regression import BASE_SEED, FULL, HERE, PAIR, SIMULATOR, Outcome

# Registers start at X instead of the value that Verilog's initialisers give them: the real part
# has no such thing. Yosys' own helper signals keep theirs.
INITIALISER = re.compile(r"^(\s*reg (?:\[\d+:0\] )?[^$;=]*?) = \d+'h\w+;$", re.MULTILINE)


# For the words of failed assertions cocotb loads pytest with all its plugins, in each simulation.
# The traced run of a failed test has them.
REWRITING = "COCOTB_REWRITE_ASSERTION_FILES"
os.environ.setdefault(REWRITING, "")


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    folder = os.environ.get("HDL_COVERAGE")
    if folder and not hasattr(config, "workerinput"):
        path = Path(folder).resolve()
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir(parents=True)
        os.environ["HDL_COVERAGE"] = str(path)
    if FULL and not hasattr(config, "workerinput"):
        reporter = config.pluginmanager.get_plugin("terminalreporter")
        config.pluginmanager.register(Progress(reporter._tw, reporter.isatty), "hdl-progress")


def pytest_report_header() -> str:
    return f"hdl: {SIMULATOR}, HDL_SEED={BASE_SEED}"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if "icarus" in getattr(item, "fixturenames", ()):
            item.add_marker("cocotb")


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """With ``HDL_COVERAGE`` a regression that leaves out a declared point fails."""
    folder = os.environ.get("HDL_COVERAGE")
    here = not hasattr(session.config, "workerinput")
    judged = folder and here and exitstatus == 0 and SIMULATOR == "icarus"
    if judged and points.missed(points.merged(Path(folder))):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any) -> None:
    if folder := os.environ.get("HDL_COVERAGE"):
        terminalreporter.section("functional coverage")
        for line in points.table(points.merged(Path(folder))):
            terminalreporter.write_line(line)


#: Modules with tests that drive unknown levels, which Verilator does not have.
X_MODULES = {*regression.modules(PAIR, "dataflow", "addressing")}

#: Waveforms of failing tests: a VCD file and a JSON file beside it for each, until it is run again.
#: `cubestack hdl wave` reads them.
WAVES = HERE.parents[1] / "out" / "hdl" / "waves"


def plain_name(node: str) -> str:
    """What the files are called: ``x.y-8-4`` for ``test_x.py::test_y[8-4]``."""
    file, _, test = node.partition("::")
    parts = Path(file).stem.removeprefix("test_"), test.removeprefix("test_")
    return ".".join(re.sub(r"\W+", "-", part).strip("-") for part in parts)


def describe(path: Path, node: str, seed: int, failed: Outcome, again: Outcome) -> str:
    """Write what the waveform shows beside it; a line for the reader.

    ``failed`` is the run of all tests, ``again`` the first failed one alone.
    """
    if not path.exists():
        return "no waveform was written"
    title = f"{failed.failed[0]} of {node}, seed {seed + BASE_SEED}, on {SIMULATOR}"
    about = {"test": node, "title": title, "error": again.error or failed.error}
    path.with_suffix(".json").write_text(json.dumps(about, indent=1), encoding="utf-8")
    alone = "" if again.failed else ", in which it passed alone"
    return f"waveform{alone}: {path}; look at it with: cubestack hdl wave {path.stem}"


class Icarus:
    """Builds each design once, then runs any number of cocotb modules on it.

    With ``HDL_SIMULATOR`` another simulator does, except for runs that need unknown levels.
    """

    def __init__(self, folder: Path, kept: Path = WAVES) -> None:
        self._folder = folder
        self._kept = kept
        self._built: dict[str, Runner] = {}
        self._runs = 0

    def run(
        self,
        design: regression.Design,
        columns: int,
        rows: int,
        *modules: str,
        seed: int,
        harness: Path | None = None,
        initialised: bool = True,
        text: Callable[[Component, str], str] = verilog_text,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """Run the cocotb ``modules`` on ``design``, or on the file ``harness`` around it.

        The file's top module has its name.
        ``text`` makes Verilog of the design, as module of the name that it is given.
        Fails with the names of the cocotb tests that failed, the first one's waveform and the end
        of the log.
        """
        if SIMULATOR != "icarus" and (harness or not initialised or X_MODULES & {*modules}):
            pytest.skip(f"needs Icarus: {harness or 'unknown levels'}")
        print(f"{design.__name__} {columns}x{rows} COCOTB_RANDOM_SEED={seed + BASE_SEED}")
        top = harness.stem if harness else "dut"
        name = f"{design.__name__}-{columns}x{rows}-{top}-{initialised}-{text.__name__}"
        folder = self._folder / name
        make = partial(
            regression.build,
            folder / "dut.v",
            top=top,
            further=[harness] if harness else [],
            parameters={"COLUMNS": columns, "ROWS": rows} if harness else {},
        )
        if name not in self._built:
            folder.mkdir()
            verilog = text(design(columns, rows), "dut")
            if not initialised:
                verilog, changed = INITIALISER.subn(r"\1;", verilog)
                assert changed
            (folder / "dut.v").write_text(verilog, encoding="utf-8")
            self._built[name] = make(folder)
        settings = {**regression.frame_environment(columns, rows), "DESIGN": design.__name__}
        settings |= environment or {}
        run = partial(regression.simulate, seed=seed, top=top, environment=settings)
        self._runs += 1
        place = self._folder / f"{self._runs}"
        outcome = run(self._built[name], modules, place)
        node = os.environ["PYTEST_CURRENT_TEST"].rpartition(" ")[0]
        for path in self._kept.glob(f"{plain_name(node)}.*"):
            path.unlink(missing_ok=True)
        if outcome.failed:
            # The seed makes it the same run again.
            first = outcome.failed[0]
            failed = [*outcome.failed[:20], *(["…"] if len(outcome.failed) > 20 else [])]
            self._kept.mkdir(parents=True, exist_ok=True)
            case = re.sub(r"[^\w.]+", "-", first)
            path = self._kept / f"{plain_name(node)}.{case}.vcd"
            traced = make(self._folder / f"{name}-traced", traced=True)
            with simulator.environment(**{REWRITING: "*.py"}):
                again = run(traced, modules, place / "traced", only=first, waveform=path)
            kept = describe(path, node, seed, outcome, again)
            log = (again if again.failed else outcome).log
            raise AssertionError(f"cocotb tests failed: {failed}\n{kept}\n{log[-6000:]}")
        assert not outcome.problem, f"{outcome.problem}\n{outcome.log[-4000:]}"


@pytest.fixture(scope="session")
def icarus(tmp_path_factory: pytest.TempPathFactory) -> Icarus:
    if SIMULATOR == "icarus" and shutil.which("iverilog") is None:
        pytest.fail("Icarus Verilog is needed: apt-get install iverilog")
    return Icarus(tmp_path_factory.mktemp("icarus"))
