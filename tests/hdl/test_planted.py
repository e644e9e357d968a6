"""Bugs planted by hand in the source of the designs: the tier of each top that has one finds it."""

import re
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
from tests.together import together


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
TOPS = {
    "star": STAR,
    **{name: f"cubestar-{name}" for name in ("shared", "double", "boards", "shared-latch")},
    "pair": "cubesense-pair",
    "addressing": "cubesense-pair-addressing",
}

#: By kind: title, module and tops of each; its text, with ``{{right->wrong}}`` in it. ``LAST`` is
#: that the picture's last pixel is stored.
_TABLE = r"""
off by one
  a row ends a column early | blocks.counters | star shared double pair boards
    column == self._columns - {{1->2}}
  a frame has a row more | blocks.counters | star shared double pair
    row == self._rows {{- 1->% (1 << len(row))}}
  a nadir scan's line ends early | cubesense.nadir_scan | pair
    size.rows - {{1->2}}, size.columns - 1
  the Sun window starts a column too far right | cubesense.sun_window | pair
    self._position(m, "right", size.window_left{{-> - 1}}, in_window)
  a gap is one clock shorter | blocks.frames | pair
    low_clocks == self._clocks{{-> - 1}}
swapped condition
  a line is taken while HSYNC is low | blocks.frames | star shared double pair
    {{->~}}self.hsync\n                & self.vsync\n
  the address multiplexer's sides | cubestar.top | star
    Mux(self.RNW, {{reader.address, writer.address->writer.address, reader.address}})
  reading and writing on the bus | blocks.bus_port | shared double boards
    self.writing.eq(self.selected & {{self.re_n & ->}}~self.we_n)
  the direction across the link | cubesense.dataflow | pair
    (self.rnw{{-> ^ (self.shift & ~self.edge)}}, command.rnw),
missing reset
  a store that begins inside of a line takes it | blocks.frames | star
    between_lines_seen = Signal({{->reset_less=True}})
  rows are counted on | blocks.counters | star pair
    row = Signal(range(self._rows){{->, reset_less=True}})
  a short last row is not forgotten | blocks.frames | star
    frame_full = Signal({{->reset_less=True}})  # the
  the reader goes on where it was | cubestar.top | star
    ResetSignal("dclk").eq({{~reading->0}})
  the address latch keeps what it has | blocks.bus_port | shared-latch
    ResetSignal("ale").eq({{~self.on->0}})
  a scan goes on where it was | cubesense.nadir_scan | pair
    vertical = Signal({{->reset_less=True}})
  a taken address outlives standby | cubesense.reader | addressing
    picture_wanted = self.picture | self.addressing{{-> | ~(self.scan | self.window)}}
wrong bank
  BANK is inverted | cubestar.top | star
    bank.eq({{self.BANK->~self.BANK}})
  BANK is not latched | cubestar.top | star
    {{m.d.enable->m.d.comb}} += bank.eq(self.BANK)
  BANK is not latched | cubestar.shared_top | shared boards
    m.d.{{enable->comb}} += bank.eq({{->~}}self.BANK)
  the other memory is stored in | cubestar.double_top | double
    m.d.start += into.eq({{self.INTO->~self.INTO}})
  own and other sensor's order | cubesense.top | pair
    own_edge, other_edge = orders{{->[::-1]}} if is_sun else orders{{[::-1]->}}
  the Sun is looked for in the other camera's picture | cubesense.top | pair
    sun_writer = {{own->link}}_writer if is_sun else {{link->own}}_writer
late ACK
  one pixel clock | blocks.frames | star shared double pair
    {{self.ack.eq(self.ack | (->(late := Signal()).eq(}}storing_last_column & counter.last_row)\
    {{)->, self.ack.eq(self.ack | late)}},
early ACK
  a row | blocks.frames | star shared double pair
    self.ack.eq(self.ack | ({{storing_last_column->self.store}} & counter.last_row)),
  before the last write pulse | cubestar.top | star
    writer = self._add_writer(m, storing){{->; m.d.comb += self.ACK.eq(writer.ack | (writer.LAST))}}
  before the last write pulse | cubesense.top | pair
    self.ACK.eq(own_ack | link_writer.ack{{-> | (own_writer.LAST)}})
extra WE pulse
  after the last pixel | blocks.frames | star shared double pair
    self.store.eq(accept{{-> | (storing_last_column & counter.last_row)}}),
  after a row | blocks.frames | star shared double pair
    {{                & ~storing_last_column\n->}}
  in the clock's high half | cubestar.top | star
    self.SRAM_WE_N.eq(~writer.store{{ | self.PIXCLK->}})
"""


def _bugs() -> Iterator[Bug]:
    kind = title = module = tops = ""
    for line in re.sub(r"\\\n +", "", _TABLE).strip().splitlines():
        text = line.lstrip()
        if text == line:
            kind = text
        elif " | blocks." in line or " | cube" in line:
            title, module, tops = text.split(" | ")
        else:
            size = "self.read_out" if module == "cubesense.top" else "self"
            last = f"(({size}.rows - 1) << ({size}.columns - 1).bit_length()) + {size}.columns - 1"
            text = re.sub(r"(\w+)\.LAST", rf"\1.store & (\1.address == {last})", text)
            text = text.replace(r"\n", "\n")
            texts = [re.sub(r"{{(.*?)->(.*?)}}", way, text, flags=re.S) for way in (r"\1", r"\2")]
            yield Bug(kind, title, module, *texts, tuple(TOPS[top] for top in tops.split()))


BUGS = tuple(_bugs())


def source_of(bug: Bug) -> str:
    """The text of the bug's module; ValueError unless it has ``bug.old`` exactly once."""
    file = str(import_module(f"cubestack.hdl.{bug.module}").__file__)
    text = Path(file).read_text(encoding="utf-8")
    if (times := text.count(bug.old)) != 1:
        raise ValueError(f"{bug.module} has {bug.old!r} {times} times, not once")
    return text


@contextmanager
def planted(bug: Bug) -> Iterator[dict[str, object]]:
    """Everything that the designs and the tiers know of the bug's module has the bug.

    Yields the names that the module defines.
    """
    module = import_module(f"cubestack.hdl.{bug.module}")
    text = source_of(bug)
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


@pytest.mark.parametrize(("bug", "top"), quick(CASES, 1))
def test_planted_bug_is_caught(bug: Bug, top: str, tmp_path: Path) -> None:
    (tmp_path / "dut.v").write_text(wrong_verilog(bug, top), encoding="utf-8")
    outcome = run_tier(top, tmp_path / "dut.v", tmp_path / "tier")
    assert outcome.failed, outcome.problem or "not caught"


@together("bug", BUGS, ids=lambda bug: f"{bug.title}, {bug.module}")
def test_planted_text_occurs_once_in_its_module(bug: Bug) -> None:
    source_of(bug)


def test_every_kind_is_planted_in_both_sensors() -> None:
    for kind in KINDS:
        tops = {top for bug in BUGS if bug.kind == kind for top in bug.tops}
        assert {"cubestar", "cubesense-pair"} <= tops, kind


def test_documentation_lists_every_planted_bug() -> None:
    document = Path(__file__).parents[2] / "docs" / "gateware-tests.md"
    _, _, section = document.read_text(encoding="utf-8").partition("| Kind | Bugs |\n|---|---|\n")
    titles = {kind: dict.fromkeys(b.title for b in BUGS if b.kind == kind) for kind in KINDS}
    rows = [f"| {kind} | {'; '.join(those)} |" for kind, those in titles.items()]
    assert section.startswith("\n".join([*rows, "\n"]))


@pytest.mark.slow
def test_planting_a_bug_leaves_the_design_unchanged() -> None:
    before = verilog_text(TIERS[STAR].make(), "dut")
    wrong_verilog(BUGS[0], STAR)
    assert verilog_text(TIERS[STAR].make(), "dut") == before


def test_missing_text_is_an_error() -> None:
    bug = Bug("", "", "blocks.frames", "no such text", "", (STAR,))
    with pytest.raises(ValueError, match="has 'no such text' 0 times, not once"):
        wrong_verilog(bug, STAR)
