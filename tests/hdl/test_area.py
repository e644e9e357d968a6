"""Tile counts: known small designs by hand, and that every top fits its part."""

import re
from pathlib import Path

import pytest
from amaranth.hdl import ClockDomain, ClockSignal, Module, ResetSignal
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.area import AGLN030_TILES, TileCount, UnknownCellError, count_tiles
from cubestack.hdl.cubesense_top import CubeSenseFpga
from cubestack.hdl.cubestar_top import CubeStarTop
from cubestack.hdl.gray_counter import GrayCounter
from cubestack.hdl.matrix_counter import MatrixCounter

DOCS = Path(__file__).parents[2] / "docs"


class Function(Component):
    """Combinational: ``y`` is a function of ``a`` and ``b``."""

    def __init__(self, width, function, result=1):
        self._function = function
        super().__init__({"a": In(width), "b": In(width), "y": Out(result)})

    def elaborate(self, platform):
        m = Module()
        m.d.comb += self.y.eq(self._function(self.a, self.b))
        return m


class Register(Component):
    """One flip-flop with all that a tile has: an enable and an asynchronous clear."""

    d: In(1)
    en: In(1)
    clk: In(1)
    clear: In(1)
    q: Out(1)

    def elaborate(self, platform):
        m = Module()
        m.domains.sync = ClockDomain(async_reset=True)
        m.d.comb += [ClockSignal().eq(self.clk), ResetSignal().eq(self.clear)]
        with m.If(self.en):
            m.d.sync += self.q.eq(self.d)
        return m


@pytest.mark.parametrize(
    ("width", "function", "result", "tables"),
    [
        (1, lambda a, b: a, 1, 0),
        (1, lambda a, b: ~a, 1, 1),
        (3, lambda a, b: a.all(), 1, 1),
        (3, lambda a, b: ~a.xor(), 1, 1),
        (4, lambda a, b: a.all(), 1, 2),
        (2, lambda a, b: (a + b)[:2], 2, 3),
        (4, lambda a, b: (a + b)[:4], 4, 7),
        (4, lambda a, b: a - a, 4, 0),
        (4, lambda a, b: a == a, 1, 0),
        (8, lambda a, b: (a < b) ^ (b > a), 1, 0),
    ],
)
def test_tables_by_hand(width, function, result, tables):
    assert count_tiles(Function(width, function, result)) == TileCount(tables, 0)


@pytest.mark.parametrize("width", [5, 7, 9, 20])
def test_wide_gates_take_few_tables(width):
    """Each table but one takes in two more inputs at best, and one more at worst."""
    tables = count_tiles(Function(width, lambda a, b: a.any())).tables
    assert (width - 1) / 2 <= tables <= 0.75 * (width - 1)


def test_flip_flop_with_enable_and_clear_is_one_tile():
    assert count_tiles(Register()) == TileCount(0, 1)
    assert count_tiles(Register()).total == 1


def test_unknown_cell_is_refused():
    with pytest.raises(UnknownCellError, match=r"not of \$mul"):
        count_tiles(Function(4, lambda a, b: a * b, 8))


@pytest.mark.parametrize(
    "make",
    [
        CubeStarTop,
        lambda: CubeSenseFpga("sun"),
        lambda: CubeSenseFpga("nadir"),
        lambda: CubeSenseFpga("sun", mcu_addressing=True),
        lambda: CubeSenseFpga("nadir", mcu_addressing=True),
    ],
    ids=["cubestar", "sun", "nadir", "sun-addressing", "nadir-addressing"],
)
def test_top_fits_its_part(make):
    tiles = count_tiles(make())
    assert tiles.flip_flops > 50
    assert tiles.total <= AGLN030_TILES


def test_gray_counter_takes_more_tiles_than_the_matrix_one():
    gray, matrix = count_tiles(GrayCounter(640 * 480)), count_tiles(MatrixCounter(640, 480))
    assert gray.flip_flops == matrix.flip_flops + 1
    assert gray.total > matrix.total


def test_documented_counts():
    rows = re.findall(
        r"^\| `(.+)` \| (\d+) \| (\d+) \| (\d+) \|$",
        (DOCS / "gateware-cubesense.md").read_text(encoding="utf-8"),
        re.MULTILINE,
    )
    assert len(rows) == 6
    designs = (CubeSenseFpga, GrayCounter, MatrixCounter)
    names = {design.__name__: design for design in designs}
    for name, *numbers in rows:
        tiles = count_tiles(eval(name, names))
        assert [*tiles, tiles.total] == [int(number) for number in numbers], name
