"""CubeStar's tops for the next version, on their pins, on Icarus Verilog."""

import gc
from typing import Any

import pytest
from amaranth.hdl import Module
from amaranth.lib.wiring import Component, In

from cubestack.hdl.blocks.bus_port import BusPort
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.cubestar.two_boards import CubeStarTwoBoards


class PublishedPins(CubeStarTop):
    """The shared-memory board with the published pins; its bus rests, so nothing is read."""

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.board = board = CubeStarShared(self.columns, self.rows)
        for name, member in board.signature.members.items():
            if name in self.signature.members:
                inside, outside = getattr(board, name), getattr(self, name)
                m.d.comb += inside.eq(outside) if member.flow is In else outside.eq(inside)
        return m


@pytest.mark.parametrize(("columns", "rows", "seed"), [(8, 4, 1), (5, 3, 2)])
def test_stores_as_the_published_board(icarus: Any, columns: int, rows: int, seed: int) -> None:
    icarus.run(PublishedPins, columns, rows, "benches_store", seed=seed)


DESIGNS: dict[str, type[Component]] = {
    "benches_shared": CubeStarShared,
    "benches_double": CubeStarDouble,
    "benches_boards": CubeStarTwoBoards,
}


@pytest.mark.parametrize(("columns", "rows", "seed"), [(8, 4, 1), (5, 3, 2), (32, 16, 3)])
@pytest.mark.parametrize("module", DESIGNS)
def test_bus(icarus: Any, module: str, columns: int, rows: int, seed: int) -> None:
    icarus.run(DESIGNS[module], columns, rows, module, seed=seed)


@pytest.mark.parametrize("module", DESIGNS)
def test_needs_no_initial_values(icarus: Any, module: str) -> None:
    icarus.run(DESIGNS[module], 5, 3, module, seed=1, initialised=False)


@pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
@pytest.mark.parametrize("width", [0, 25])
def test_impossible_address_is_refused(width: int) -> None:
    with pytest.raises(ValueError, match=f"address_width must be in 1..24, not {width}"):
        BusPort(width)
    gc.collect()  # what was refused is never elaborated; have Amaranth say so here
