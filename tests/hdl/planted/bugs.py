"""Bugs planted by hand in the source of the designs, for the regression to catch."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest


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
        ("a row ends a column early", "blocks.matrix_counter", (*WRITERS, BOARDS)): (
            "column == self._columns - 1",
            "column == self._columns - 2",
        ),
        ("a frame has a row more", "blocks.matrix_counter", WRITERS): (
            "row == self._rows - 1",
            "row == self._rows % (1 << len(row))",
        ),
        ("a nadir scan's line ends early", "cubesense.nadir_scan", (PAIR,)): (
            "size.rows - 1, size.columns - 1",
            "size.rows - 2, size.columns - 1",
        ),
        ("the Sun window starts a column too far right", "cubesense.sun_window", (PAIR,)): (
            "right, last_column = self._position(m, size.window_left, in_window)",
            "right, last_column = self._position(m, size.window_left - 1, in_window)",
        ),
        ("a gap is one clock shorter", "blocks.frame_gap", (PAIR,)): (
            "low_clocks == self._clocks",
            "low_clocks == self._clocks - 1",
        ),
    },
    "swapped condition": {
        ("a line is taken while HSYNC is low", "blocks.frame_writer", WRITERS): (
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
        ("a store that begins inside of a line takes it", "blocks.frame_writer", (STAR,)): (
            "between_lines_seen = Signal()",
            "between_lines_seen = Signal(reset_less=True)",
        ),
        ("rows are counted on", "blocks.matrix_counter", (STAR, PAIR)): (
            "row = Signal(range(self._rows))",
            "row = Signal(range(self._rows), reset_less=True)",
        ),
        ("a short last row is not forgotten", "blocks.frame_writer", (STAR,)): (
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
        ("one pixel clock", "blocks.frame_writer", WRITERS): (
            "self.ack.eq(self.ack | (storing_last_column & counter.last_row)),",
            "(late := Signal()).eq(storing_last_column & counter.last_row),\n"
            "            self.ack.eq(self.ack | late),",
        )
    },
    "early ACK": {
        ("a row", "blocks.frame_writer", WRITERS): (
            "self.ack.eq(self.ack | (storing_last_column & counter.last_row)),",
            "self.ack.eq(self.ack | (self.store & counter.last_row)),",
        ),
        ("before the last write pulse", "cubestar.top", (STAR,)): (
            "writer = self._add_writer(m, storing)\n",
            "writer = self._add_writer(m, storing)\n        m.d.comb += "
            f"self.ACK.eq(writer.ack | (writer.store & (writer.address == {_LAST})))\n",
        ),
        ("before the last write pulse", "cubesense.top", (PAIR,)): (
            "self.ACK.eq(own_writer.ack | link_writer.ack)",
            "self.ACK.eq(own_writer.ack | link_writer.ack | (own_writer.store & (own_writer.address"
            f" == {_LAST.replace('self.', 'self.read_out.')})))",
        ),
    },
    "extra WE pulse": {
        ("after the last pixel", "blocks.frame_writer", WRITERS): (
            "self.store.eq(accept),",
            "self.store.eq(accept | (storing_last_column & counter.last_row)),",
        ),
        ("after a row", "blocks.frame_writer", WRITERS): (
            "                & ~storing_last_column\n",
            "",
        ),
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
