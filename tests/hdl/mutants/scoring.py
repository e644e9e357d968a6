"""Simulates mutants in tiers of the regression, proves equivalent ones, keeps results in a file.

A mutant is killed when a simulation fails, also by hanging; equivalent when a proof says so; else
it survived. The file has one JSON object a line. What it has of killed and equivalent mutants of
the same netlist counts; a survivor is tried again.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from amaranth.hdl import ClockDomain, ClockSignal, Module, ResetSignal
from amaranth.lib.wiring import Component, In

from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.blocks.pinned import connect_ports
from cubestack.hdl.cubestar.shared_top import CubeStarShared
from cubestack.hdl.flow.generate import verilog_text
from tests.hdl.cubestar.as_published import AsPublished, DoubleAsPublished, SharedAsPublished
from tests.hdl.mutants.equivalence import Equivalence
from tests.hdl.mutants.netlist import Mutant, Netlist, mutants, netlist, selectable
from tests.hdl.regression import (
    ANY_TOP,
    PAIR,
    STAR,
    TIERS,
    Outcome,
    build,
    frame_environment,
    modules,
    simulate,
)


@dataclass(frozen=True)
class Stage:
    """One simulation of cocotb ``modules``, on the module ``top``."""

    modules: tuple[str, ...]
    seed: int
    top: str = "dut"


@dataclass(frozen=True)
class Suite:
    """A design, of a small picture, and what a mutant of it has to pass."""

    make: Callable[[], Component]
    stages: tuple[Stage, ...]  # what finds most first
    environment: Mapping[str, str]  # of the cocotb modules
    standby: Mapping[str, int]  # levels of inputs that make the state
    kept: tuple[str, ...] = ()  # submodules whose signals the cocotb modules look at
    wrapper: Callable[[], Component] | None = None  # around ``dut``, for stages with another top
    source: str = ""  # file of the design's source that the mutants are of, if not of all


class CounterAlone(Component):
    """A matrix counter that is reset without a clock, as in the boards."""

    def __init__(self, columns: int, rows: int) -> None:
        self._counter = MatrixCounter(columns, rows)
        super().__init__({**self._counter.signature.members, "clk": In(1), "rst": In(1)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.counter = self._counter
        m.domains.sync = ClockDomain(async_reset=True)
        m.d.comb += [ClockSignal().eq(self.clk), ResetSignal().eq(self.rst)]
        connect_ports(m, self._counter, self, ((n, n) for n in self._counter.signature.members))
        return m


def _seeds(modules: tuple[str, ...], count: int, top: str = "dut") -> tuple[Stage, ...]:
    return tuple(Stage(modules, seed, top) for seed in range(1, count + 1))


def _suite(name: str, *stages: Stage, standby: Mapping[str, int], **options: Any) -> Suite:
    return Suite(TIERS[name].make, stages, TIERS[name].environment, standby, **options)


def _next(name: str, wrapped: type[AsPublished], standby: Mapping[str, int]) -> Suite:
    """A board of the next version: its own testbenches, and the published board's of storing."""
    tier = TIERS[name]
    published = modules(STAR, "store", "borders")
    return _suite(
        name,
        *_seeds(tier.modules, 1),
        *_seeds(published, 1, "published"),
        *_seeds((ANY_TOP,), 1),
        *_seeds(tier.modules, 3)[1:],
        *_seeds(published, 2, "published")[1:],
        standby=standby,
        wrapper=lambda: wrapped(tier.columns, tier.rows, "dut"),
    )


#: By name: tops as on the command line, one's bus, and a block that is done in seconds.
SUITES = {
    "cubestar": _suite(
        "cubestar",
        *_seeds(TIERS["cubestar"].modules, 1),
        *_seeds((*modules(STAR, "borders"), ANY_TOP), 1),
        *_seeds(TIERS["cubestar"].modules, 3)[1:],
        standby={"ENABLE": 0},
    ),
    "cubestar-shared": _next("cubestar-shared", SharedAsPublished, {"ENABLE": 0}),
    "cubestar-double": _next("cubestar-double", DoubleAsPublished, {"ENABLE": 0}),
    "cubesense-pair": _suite(
        "cubesense-pair",
        *_seeds(TIERS["cubesense-pair"].modules, 1),
        *_seeds((*modules(PAIR, "borders"), ANY_TOP), 1),
        *_seeds(TIERS["cubesense-pair"].modules, 2)[1:],
        standby={"SUNEN": 1, "NADEN": 1},
        kept=("sun", "nadir"),
    ),
    # A picture so large that its address needs the latch.
    "cubestar-shared-bus": Suite(
        lambda: CubeStarShared(5, 33),
        _seeds(modules(STAR, "bus", "shared"), 2),
        TIERS["cubestar-shared"].environment | frame_environment(5, 33),
        {"ENABLE": 0},
        source="bus_port.py",
    ),
    "matrix-counter": Suite(
        lambda: CounterAlone(5, 3),
        _seeds(("tests.hdl.blocks.testbenches.matrix_counter",), 1),
        frame_environment(5, 3),
        {"rst": 1},
    ),
}


#: A simulation hangs after this multiple of its duration without a mutant, and at least 120 s.
PATIENCE, SHORTEST = 20, 120

CHUNK = 250  #: Mutants in one compiled file


@dataclass(frozen=True)
class Result:
    """What became of one mutant.

    ``outcome`` is "killed", "equivalent" or "survived". ``by`` is the cocotb test that killed it,
    or what else the simulation came to. ``steps`` are the least, as clocks' edges or other changes,
    after which a pin shows a survivor; None when that is not known.
    """

    mutant: str
    outcome: str
    by: str = ""
    seed: int = 0
    seconds: float = 0.0
    steps: int | None = None


class Score(NamedTuple):
    killed: int
    equivalent: int
    survived: int

    @property
    def share(self) -> float:
        """Of the mutants that are not equivalent, the killed ones."""
        counted = self.killed + self.survived
        return self.killed / counted if counted else 1.0


class Scoring:
    """One suite's mutants: ``count`` of them, or all with None; the same seed gives the same.

    Without ``proofs`` what is equivalent survives.
    """

    def __init__(
        self, name: str, suite: Suite, folder: Path, *, count: int | None, seed: int, proofs: bool
    ) -> None:
        self._suite = suite
        self._proofs = proofs
        self._folder = folder / name
        self._folder.mkdir(parents=True, exist_ok=True)
        self._file = self._folder / "results.jsonl"
        self._design = suite.make()
        self._netlist: Netlist = netlist(self._design, suite.kept)
        self.mutants: list[Mutant] = mutants(self._netlist, count, seed, suite.source)

    def results(self) -> Iterator[Result]:
        """One for each mutant, in their order; AssertionError when the design itself fails."""
        done = self._done()
        for start in range(0, len(self.mutants), CHUNK):
            chunk = self.mutants[start : start + CHUNK]
            bench: _Bench | None = None
            for number, mutant in enumerate(chunk, 1):
                found = done.get(mutant.command())
                if found is None:
                    bench = bench or _Bench(self._suite, self._netlist, chunk, self._folder)
                    found = bench.simulated(number, mutant)
                    if self._proofs and found.outcome == "survived":
                        found = self._judged(mutant, found)
                    self._keep(mutant, found)
                yield found

    def _judged(self, mutant: Mutant, result: Result) -> Result:
        verdict = self._equivalence.compare(mutant)
        outcome = "equivalent" if verdict.equivalent else "survived"
        seconds = round(result.seconds + verdict.seconds, 1)
        return replace(result, outcome=outcome, seconds=seconds, steps=verdict.steps)

    @cached_property
    def _equivalence(self) -> Equivalence:
        return Equivalence(self._netlist, self._design, self._suite.standby)

    def _done(self) -> dict[str, Result]:
        if not self._file.exists():
            return {}
        lines = self._file.read_text(encoding="utf-8").splitlines()
        entries: list[dict[str, Any]] = [json.loads(line) for line in lines]
        return {
            entry["command"]: Result(**entry["result"])
            for entry in entries
            if entry["netlist"] == self._netlist.digest and entry["result"]["outcome"] != "survived"
        }

    def _keep(self, mutant: Mutant, result: Result) -> None:
        entry = {"netlist": self._netlist.digest, "command": mutant.command()}
        with self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps({**entry, "result": asdict(result)}) + "\n")


class _Bench:
    """Mutants in one Verilog file, compiled once for each top of the stages."""

    def __init__(
        self, suite: Suite, design: Netlist, chunk: Sequence[Mutant], folder: Path
    ) -> None:
        self._suite = suite
        self._folder = folder
        source = folder / "dut.v"
        source.write_text(selectable(design, chunk), encoding="utf-8")
        self._runners = {}
        for top in {stage.top for stage in suite.stages}:
            further = []
            if suite.wrapper and top != "dut":
                further.append(folder / f"{top}.v")
                further[0].write_text(verilog_text(suite.wrapper(), top), encoding="utf-8")
            into = folder / f"build-{top}"
            self._runners[top] = build(source, into, top=top, further=further, strict=False)
        self._limits: dict[Stage, int] = {}

    def simulated(self, number: int, mutant: Mutant) -> Result:
        """Killed or survived; the design itself is simulated before a stage's first mutant."""
        seconds = 0.0
        for stage in self._suite.stages:
            if stage not in self._limits:
                outcome = self._simulate(stage, 0, 3600)
                assert outcome.passed, f"without a mutant: {outcome.failed or outcome.problem}"
                self._limits[stage] = max(SHORTEST, int(PATIENCE * outcome.seconds))
            outcome = self._simulate(stage, number, self._limits[stage])
            seconds += outcome.seconds
            if not outcome.passed:
                by = outcome.failed[0] if outcome.failed else outcome.problem
                return Result(str(mutant), "killed", by, stage.seed, round(seconds, 1))
        return Result(str(mutant), "survived", seconds=round(seconds, 1))

    def _simulate(self, stage: Stage, number: int, limit_s: int) -> Outcome:
        return simulate(
            self._runners[stage.top],
            stage.modules,
            self._folder / "run",
            seed=stage.seed,
            top=stage.top,
            environment={**self._suite.environment, "SIM_CMD_SUFFIX": f"+mutant={number}"},
            limit_s=limit_s,
            failures=1,
        )
