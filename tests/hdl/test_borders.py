"""Border cases on every way that a picture can take, and on the bus, on Icarus Verilog."""

from typing import Any

import pytest
from amaranth.lib.wiring import Component
from published import AsPublished, DoubleAsPublished, SharedAsPublished
from regression import TIERS

from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.generate import verilog_text

COLUMNS, ROWS = 5, 3
BOARDS: dict[type[AsPublished], type[Component]] = {
    SharedAsPublished: CubeStarShared,
    DoubleAsPublished: CubeStarDouble,
}


def with_board(wrapper: AsPublished, name: str) -> str:
    """The wrapper and the board in it."""
    board = BOARDS[type(wrapper)](wrapper.columns, wrapper.rows)
    return verilog_text(wrapper, name) + verilog_text(board, "board")


def test_published_board(icarus: Any) -> None:
    icarus.run(CubeStarTop, COLUMNS, ROWS, "benches_borders", seed=1)


@pytest.mark.parametrize("wrapper", BOARDS)
def test_next_version_stores_like_it(icarus: Any, wrapper: type[AsPublished]) -> None:
    modules = ("benches_store", "benches_borders")
    icarus.run(wrapper, COLUMNS, ROWS, *modules, seed=1, text=with_board)


@pytest.mark.parametrize(
    ("name", "bench"), [("cubestar-shared", "SharedBench"), ("cubestar-double", "DoubleBench")]
)
def test_strobes_for_another_chip(icarus: Any, name: str, bench: str) -> None:
    tier = TIERS[name]
    environment = {**tier.environment, "BENCH": f"bench_next:{bench}"}
    icarus.run(
        tier.design,
        tier.columns,
        tier.rows,
        "benches_unselected",
        seed=1,
        environment=environment,
    )


def test_pair(icarus: Any) -> None:
    tier = TIERS["cubesense-pair"]
    icarus.run(
        tier.design,
        tier.columns,
        tier.rows,
        "benches_pair_borders",
        seed=1,
        environment=tier.environment,
    )
