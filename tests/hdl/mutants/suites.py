"""Which simulations a mutant of each top has to pass: tiers of the regression, small pictures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from amaranth.hdl import ClockDomain, ClockSignal, Module, ResetSignal
from amaranth.lib.wiring import Component, In

from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.blocks.pinned import connect_ports
from cubestack.hdl.cubestar.shared_top import CubeStarShared
from tests.hdl.cubestar.as_published import AsPublished, DoubleAsPublished, SharedAsPublished
from tests.hdl.regression import ANY_TOP, PAIR, STAR, TIERS, frame_environment, modules


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
