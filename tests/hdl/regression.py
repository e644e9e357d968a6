"""Runs cocotb modules on a Verilog file: what pytest's fixtures and the mutants share.

:func:`simulate` runs any modules, :func:`run_tier` the tier of a top on a given file.

From the environment: ``HDL_SEED`` is added to every seed, ``HDL_SIMULATOR`` is ``icarus`` (default)
or ``verilator``, ``HDL_TIER=full`` is what `make test-hdl` runs besides what `make test` does.
"""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from amaranth.lib.wiring import Component
from cocotb_tools.runner import Runner

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut
from cubestack.hdl.contract import simulator
from cubestack.hdl.contract.simulator import LIMIT_S, Outcome, frame_environment, text_of
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

#: Wall-clock seconds after which a tier hangs, which takes seconds.
TIER_LIMIT_S = 600

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
    ``verilogtext_of(TIERS[top].make(), "dut")`` or a mutant of it. Stops at the first cocotb test
    that fails. ``folder`` is made, and takes what the simulator writes. Whatever the design does,
    this returns: one that does not compile or hangs for ``limit_s`` seconds has a ``problem``.
    """
    tier = TIERS[top]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        runner = build(verilog, folder / "build", strict=False)
    except (RuntimeError, SystemExit):
        return Outcome(problem="does not compile", log=text_of(folder / "build" / "build.log"))
    return simulate(
        runner,
        tier.modules,
        folder / "run",
        seed=seed,
        environment=tier.environment,
        limit_s=limit_s,
        failures=1,
    )


def build(verilog: Path, folder: Path, **options: Any) -> Runner:
    """As ``cubestack.hdl.contract.simulator``, for the simulator that ``HDL_SIMULATOR`` names."""
    return simulator.build(verilog, folder, simulator=SIMULATOR, **options)


def simulate(
    runner: Runner,
    modules: Sequence[str],
    folder: Path,
    *,
    seed: int,
    environment: Mapping[str, str],
    limit_s: int = LIMIT_S,
    **options: Any,
) -> Outcome:
    """As there, on this folder's modules, with ``HDL_SEED`` added to the seed."""
    return simulator.simulate(
        runner,
        modules,
        folder,
        seed=seed + BASE_SEED,
        settings=environment,
        path=[ROOT],
        simulator=SIMULATOR,
        limit_s=limit_s,
        **options,
    )
