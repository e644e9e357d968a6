"""The compiled engine on foreign designs, pin by pin against Icarus Verilog on their source."""

import shutil
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.contract import PinEvent
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.tools import have_yosys
from tests.hdl.user.designs import CLOCK_STYLES, FOLDER, WORKING, load_design
from tests.tiers import quick_ones

from .board_events import BOARDS, COLUMNS, ROWS, random_events
from .icarus_board import IcarusBoard, Played

pytestmark = [
    pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed"),
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
    pytest.mark.skipif(not have_yosys(), reason="no whole Yosys"),
]

DESIGNS = {**WORKING, CLOCK_STYLES.stem: CLOCK_STYLES}
#: Events with which each output of the shipped design moves.
SEED, END_PS = 8, 80_000_000

#: Changes that put every register with a reset into it: an edge, as Verilog needs one.
RESET = (
    *(("VSYNC", 1), ("RNW", 1), ("ENABLE", 1), ("ENABLE", 0), ("RNW", 0)),
    *(("ENABLE", 1), ("ENABLE", 0), ("VSYNC", 0)),
)

#: How a design with a bidirectional pin drives it, by name.
BUSES = {"data_bus": ("dut.pixel", "dut.write")}


def source(name: str, wiring: Wiring, registers: list[str]) -> str:
    """The design as module "top", with registers that start at 0 as in the compiled engine."""
    ports, connections = [], []
    for pin, width in wiring.widths.items():
        kind = "input" if pin in wiring.initial else "output"
        ports.append(f"{kind} [{width - 1}:0] {pin}")
        if name not in BUSES or not pin.startswith("SRAM_D_"):
            connections.append(f".{pin}({pin})")
    extra = ""
    if name in BUSES:
        level, on = BUSES[name]
        connections.append(".SRAM_D(bus)")
        extra = (
            f"wire [7:0] bus; assign bus = {on} ? 8'bz : SRAM_D_I;\n"
            f"assign SRAM_D_O = {level}; assign SRAM_D_OE = {on};\n"
        )
    if name == CLOCK_STYLES.stem:
        registers = []  # they have initial values
    start = "\n".join(f"$deposit(dut.{register}, 0);" for register in registers)
    return (
        f"module top({', '.join(ports)});\n{extra}"
        f"{name} #(.COLUMNS({COLUMNS}), .ROWS({ROWS})) dut({', '.join(connections)});\n"
        f"initial begin\n{start}\nend\nendmodule\n{DESIGNS[name].read_text()}"
    )


def difference(wiring: Wiring, found: Played, expected: Played) -> str:
    """The first pin that differs; a data line that is not driven may have any level."""
    pins = {name: n for n, name in enumerate(wiring.output_pins)}
    wrong = found.outputs != expected.outputs
    wrong[: len(RESET)] = False
    wrong[:, pins["SRAM_D_O"]] &= expected.outputs[:, pins["SRAM_D_OE"]] == 1
    places = np.argwhere(wrong)
    if not len(places):
        return "" if found.memories == expected.memories else "memory"
    row, pin = places[0]
    levels = f"{found.outputs[row, pin]}, not {expected.outputs[row, pin]}"
    return f"{wiring.output_pins[pin]} is {levels} after event {row}"


@pytest.mark.parametrize("name", quick_ones(DESIGNS, "clock_styles"))
def test_compiled_engine_agrees_with_icarus(name: str, tmp_path: Path) -> None:
    wiring = cubestar_wiring(CubeStarTop(COLUMNS, ROWS))
    foreign = wiring.with_design(load_design(DESIGNS[name], COLUMNS, ROWS))
    rng = np.random.default_rng(SEED)
    random = random_events(BOARDS["cubestar"], wiring, rng, END_PS)
    start = [PinEvent(1_000 * n, *change) for n, change in enumerate(RESET, 1)]
    events = [*start, *(e._replace(time_ps=e.time_ps + 1_000_000) for e in random)]
    with closing(CompiledEngine(foreign)) as engine:
        outputs = engine.apply(events)
        found = Played(outputs, {name: m.tobytes() for name, m in engine.memories.items()})
        registers = list(engine.registers)
    for file in (*FOLDER.glob("*.svh"), *FOLDER.glob("*.hex")):
        shutil.copy(file, tmp_path)
    icarus = IcarusBoard(tmp_path, wiring, source(name, wiring, registers), edges=False)
    assert not difference(wiring, found, icarus.play(events))
    moving = (outputs != outputs[0]).any(axis=0)
    still = {pin for pin, moves in zip(wiring.output_pins, moving, strict=True) if not moves}
    assert not still
