"""Bugs planted by hand in the source of the designs: the tier of each top that has one finds it."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from cubestack.hdl.flow.generate import verilog_text
from tests.hdl.regression import FULL, TIERS, run_tier
from tests.tiers import quick


@dataclass(frozen=True)
class Bug:
    """A text ``old``, which a module of ``cubestack.hdl`` has once, is replaced by ``new``.

    ``tops`` are those that have the bug; names of ``regression.TIERS``.
    """

    kind: str
    title: str
    module: str
    old: str
    new: str
    tops: tuple[str, ...]


STAR = "cubestar"
SHARED, DOUBLE, BOARDS = (f"cubestar-{name}" for name in ("shared", "double", "boards"))
PAIR, ADDRESSING = "cubesense-pair", "cubesense-pair-addressing"
WRITERS = (STAR, SHARED, DOUBLE, PAIR)

#: Address of a picture's last pixel, in a top of CubeStar.
_LAST = "((self.rows - 1) << (self.columns - 1).bit_length()) + self.columns - 1"

#: By kind: title, module and tops of each; the text that it replaces, and the wrong one.
_BY_KIND = {
    "off by one": {
        ("a row ends a column early", "blocks.counters", (*WRITERS, BOARDS)): (
            "column == self._columns - 1",
            "column == self._columns - 2",
        ),
        ("a frame has a row more", "blocks.counters", WRITERS): (
            "row == self._rows - 1",
            "row == self._rows % (1 << len(row))",
        ),
        ("a nadir scan's line ends early", "cubesense.nadir_scan", (PAIR,)): (
            "size.rows - 1, size.columns - 1",
            "size.rows - 2, size.columns - 1",
        ),
        ("the Sun window starts a column too far right", "cubesense.sun_window", (PAIR,)): (
            'right, last_column = self._position(m, "right", size.window_left, in_window)',
            'right, last_column = self._position(m, "right", size.window_left - 1, in_window)',
        ),
        ("a gap is one clock shorter", "blocks.frames", (PAIR,)): (
            "low_clocks == self._clocks",
            "low_clocks == self._clocks - 1",
        ),
    },
    "swapped condition": {
        ("a line is taken while HSYNC is low", "blocks.frames", WRITERS): (
            "                self.hsync\n                & self.vsync\n",
            "                ~self.hsync\n                & self.vsync\n",
        ),
        ("the address multiplexer's sides", "cubestar.top", (STAR,)): (
            "Mux(self.RNW, reader.address, writer.address)",
            "Mux(self.RNW, writer.address, reader.address)",
        ),
        ("reading and writing on the bus", "blocks.bus_port", (SHARED, DOUBLE, BOARDS)): (
            "self.writing.eq(self.selected & self.re_n & ~self.we_n)",
            "self.writing.eq(self.selected & ~self.we_n)",
        ),
        ("the direction across the link", "cubesense.dataflow", (PAIR,)): (
            "(self.rnw, command.rnw),",
            "(self.rnw ^ (self.shift & ~self.edge), command.rnw),",
        ),
    },
    "missing reset": {
        ("a store that begins inside of a line takes it", "blocks.frames", (STAR,)): (
            "between_lines_seen = Signal()",
            "between_lines_seen = Signal(reset_less=True)",
        ),
        ("rows are counted on", "blocks.counters", (STAR, PAIR)): (
            "row = Signal(range(self._rows))",
            "row = Signal(range(self._rows), reset_less=True)",
        ),
        ("a short last row is not forgotten", "blocks.frames", (STAR,)): (
            "frame_full = Signal()  # the",
            "frame_full = Signal(reset_less=True)  # the",
        ),
        ("the reader goes on where it was", "cubestar.top", (STAR,)): (
            'ResetSignal("dclk").eq(~reading)',
            'ResetSignal("dclk").eq(0)',
        ),
        ("the address latch keeps what it has", "blocks.bus_port", ("cubestar-shared-latch",)): (
            'ResetSignal("ale").eq(~self.on)',
            'ResetSignal("ale").eq(0)',
        ),
        ("a scan goes on where it was", "cubesense.nadir_scan", (PAIR,)): (
            "vertical = Signal()",
            "vertical = Signal(reset_less=True)",
        ),
        ("a taken address outlives standby", "cubesense.reader", (ADDRESSING,)): (
            "picture_wanted = self.picture | self.addressing",
            "picture_wanted = self.picture | self.addressing | ~(self.scan | self.window)",
        ),
    },
    "wrong bank": {
        ("BANK is inverted", "cubestar.top", (STAR,)): (
            "bank.eq(self.BANK)",
            "bank.eq(~self.BANK)",
        ),
        ("BANK is not latched", "cubestar.top", (STAR,)): (
            "m.d.enable += bank.eq(self.BANK)",
            "m.d.comb += bank.eq(self.BANK)",
        ),
        ("BANK is not latched", "cubestar.shared_top", (SHARED, BOARDS)): (
            "m.d.enable += bank.eq(self.BANK)",
            "m.d.comb += bank.eq(~self.BANK)",
        ),
        ("the other memory is stored in", "cubestar.double_top", (DOUBLE,)): (
            "m.d.start += into.eq(self.INTO)",
            "m.d.start += into.eq(~self.INTO)",
        ),
        ("own and other sensor's order", "cubesense.top", (PAIR,)): (
            "own_edge, other_edge = orders if is_sun else orders[::-1]",
            "own_edge, other_edge = orders[::-1] if is_sun else orders",
        ),
        ("the Sun is looked for in the other camera's picture", "cubesense.top", (PAIR,)): (
            "sun_writer = own_writer if is_sun else link_writer",
            "sun_writer = link_writer if is_sun else own_writer",
        ),
    },
    "late ACK": {
        ("one pixel clock", "blocks.frames", WRITERS): (
            "self.ack.eq(self.ack | (storing_last_column & counter.last_row)),",
            "(late := Signal()).eq(storing_last_column & counter.last_row),\n"
            "            self.ack.eq(self.ack | late),",
        )
    },
    "early ACK": {
        ("a row", "blocks.frames", WRITERS): (
            "self.ack.eq(self.ack | (storing_last_column & counter.last_row)),",
            "self.ack.eq(self.ack | (self.store & counter.last_row)),",
        ),
        ("before the last write pulse", "cubestar.top", (STAR,)): (
            "writer = self._add_writer(m, storing)\n",
            "writer = self._add_writer(m, storing)\n        m.d.comb += "
            f"self.ACK.eq(writer.ack | (writer.store & (writer.address == {_LAST})))\n",
        ),
        ("before the last write pulse", "cubesense.top", (PAIR,)): (
            "self.ACK.eq(own_ack | link_writer.ack)",
            "self.ACK.eq(own_ack | link_writer.ack | (own_writer.store & (own_writer.address"
            f" == {_LAST.replace('self.', 'self.read_out.')})))",
        ),
    },
    "extra WE pulse": {
        ("after the last pixel", "blocks.frames", WRITERS): (
            "self.store.eq(accept),",
            "self.store.eq(accept | (storing_last_column & counter.last_row)),",
        ),
        ("after a row", "blocks.frames", WRITERS): ("                & ~storing_last_column\n", ""),
        ("in the clock's high half", "cubestar.top", (STAR,)): (
            "self.SRAM_WE_N.eq(~writer.store | self.PIXCLK)",
            "self.SRAM_WE_N.eq(~writer.store)",
        ),
    },
}

BUGS = tuple(
    Bug(kind, title, module, *texts, tops)
    for kind, bugs in _BY_KIND.items()
    for (title, module, tops), texts in bugs.items()
)


@contextmanager
def planted(bug: Bug) -> Iterator[dict[str, object]]:
    """Everything that the designs and the tiers know of the bug's module has the bug.

    Gives the names that the module defines. ValueError when it does not have the text once.
    """
    module = import_module(f"cubestack.hdl.{bug.module}")
    text = Path(str(module.__file__)).read_text(encoding="utf-8")
    if (times := text.count(bug.old)) != 1:
        raise ValueError(f"{bug.module} has {bug.old!r} {times} times, not once")
    copy = ModuleType(module.__name__)
    copy.__file__ = module.__file__
    exec(compile(text.replace(bug.old, bug.new), str(module.__file__), "exec"), vars(copy))
    replaced = {
        name: (value, vars(copy)[name])
        for name, value in vars(module).items()
        if getattr(value, "__module__", None) == module.__name__
    }
    with pytest.MonkeyPatch.context() as patch:
        for other in list(sys.modules.values()):
            name = getattr(other, "__name__", "")
            if name == "tests.hdl.regression" or name.startswith("cubestack.hdl."):
                for key, (right, wrong) in replaced.items():
                    if vars(other).get(key) is right:
                        patch.setattr(other, key, wrong)
        yield {name: wrong for name, (_, wrong) in replaced.items()}


pytestmark = [
    pytest.mark.cocotb,
    pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable"),
]

#: One of each kind, on the published board, is tried in `make test` too.
QUICK = {bug.kind: bug for bug in reversed(BUGS) if STAR in bug.tops}
KINDS = dict.fromkeys(bug.kind for bug in BUGS)
CASES = [
    pytest.param(bug, top, id=f"{bug.kind}, {bug.title}, {bug.module}-{top}")
    for bug in BUGS
    for top in bug.tops
    if FULL or (top == STAR and bug is QUICK[bug.kind])
]


def wrong_verilog(bug: Bug, top: str) -> str:
    tier = TIERS[top]
    with planted(bug) as names:
        design = names.get(tier.design.__name__, tier.design)
        return verilog_text(design(tier.columns, tier.rows), "dut")


@pytest.mark.parametrize(("bug", "top"), quick(CASES, 4))
def test_is_caught(bug: Bug, top: str, tmp_path: Path) -> None:
    (tmp_path / "dut.v").write_text(wrong_verilog(bug, top), encoding="utf-8")
    outcome = run_tier(top, tmp_path / "dut.v", tmp_path / "tier")
    assert outcome.failed, outcome.problem or "not caught"


def test_every_kind_is_planted_in_both_sensors() -> None:
    for kind in KINDS:
        tops = {top for bug in BUGS if bug.kind == kind for top in bug.tops}
        assert {"cubestar", "cubesense-pair"} <= tops, kind


def test_document_has_every_bug() -> None:
    document = Path(__file__).parents[2] / "docs" / "gateware-tests.md"
    _, _, section = document.read_text(encoding="utf-8").partition("| Kind | Bugs |\n|---|---|\n")
    titles = {kind: dict.fromkeys(b.title for b in BUGS if b.kind == kind) for kind in KINDS}
    rows = [f"| {kind} | {'; '.join(those)} |" for kind, those in titles.items()]
    assert section.startswith("\n".join([*rows, "\n"]))


def test_nothing_is_left_behind() -> None:
    before = verilog_text(TIERS[STAR].make(), "dut")
    wrong_verilog(BUGS[0], STAR)
    assert verilog_text(TIERS[STAR].make(), "dut") == before


def test_missing_text_is_an_error() -> None:
    bug = Bug("", "", "blocks.frames", "no such text", "", (STAR,))
    with pytest.raises(ValueError, match="has 'no such text' 0 times, not once"):
        wrong_verilog(bug, STAR)
