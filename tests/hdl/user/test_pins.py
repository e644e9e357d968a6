"""The pins of a user's design, compared with a device's table."""

import pytest

from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.flow.generate import rtlil_text, verilog_text
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.user import GatewareError, load_gateware
from tests.tiers import quick

pytestmark = pytest.mark.skipif(not have_yosys(), reason="no whole Yosys")

PINS = (
    Pin("CLK", "input", "clock"),
    Pin("LEDS", "output", "lamps", 4),
    Pin("BUS", "inout", "data", 2),
    Pin("OUT", "tristate", "open", bare=True),
)

GOOD = """
module counter #(parameter STEP = 1) (
  input CLK, output reg [3:0] LEDS, inout [1:0] BUS, output OUT
);
  reg on = 1;
  always @(posedge CLK) begin LEDS <= LEDS + STEP; on <= BUS[0]; end
  assign BUS = on ? LEDS[1:0] : 2'bzz;
  assign OUT = on ? LEDS[3] : 1'bz;
endmodule
"""


def loaded(tmp_path, text, name="counter.v", **parameters):
    (tmp_path / name).write_text(text)
    return load_gateware(name, PINS, parameters, tmp_path)


def test_bidirectional_pins_become_triples(tmp_path):
    gateware = loaded(tmp_path, GOOD)
    assert gateware.title == "counter.v"
    text = rtlil_text(gateware)
    for port in ("input 1 \\CLK", "width 2 output 4 \\BUS_O", "output 5 \\BUS_OE"):
        assert f"wire {port}" in text
    assert "reg [3:0] LEDS" in verilog_text(gateware) or "LEDS_register" in verilog_text(gateware)


def test_text_does_not_depend_on_the_folder(tmp_path):
    (tmp_path / "other").mkdir()
    assert rtlil_text(loaded(tmp_path, GOOD)) == rtlil_text(loaded(tmp_path / "other", GOOD))


@pytest.mark.slow
def test_parameter_changes_the_design(tmp_path):
    one, three = loaded(tmp_path, GOOD), loaded(tmp_path, GOOD, STEP=3)
    assert rtlil_text(one) != rtlil_text(three)
    with pytest.raises(GatewareError, match="no parameter ROWS; parameters: STEP"):
        loaded(tmp_path, GOOD, ROWS=3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    quick(
        [
            (
                "input CLK",
                "input clk, input CLK_",
                "pin CLK: wanted input of 1 bit, found clk: case",
            ),
            (
                "input CLK",
                "input CLK, input SYS",
                "pin SYS: found input of 1 bit, but the board has",
            ),
            (
                "[3:0] LEDS",
                "[4:0] LEDS",
                "pin LEDS: wanted output of 4 bits, found output of 5 bits",
            ),
            (
                "inout [1:0] BUS",
                "output [1:0] BUS",
                "pin BUS: wanted inout of 2 bits, found output",
            ),
            (", output OUT", ", output OUT_", "pin OUT: wanted output of 1 bit, found none"),
            ("on ? LEDS[1:0] : 2'bzz", "{on ? on : 1'bz, OUT ? on : 1'bz}", "different signals"),
        ],
        3,
    ),
)
def test_misfit_is_one_line_that_names_the_pin(tmp_path, old, new, message):
    assert old in GOOD
    with pytest.raises(GatewareError) as caught:
        loaded(tmp_path, GOOD.replace(old, new).replace("CLK)", "CLK)"))
    assert message in str(caught.value)


def test_further_output_is_a_pin_without_a_line(tmp_path):
    text = GOOD.replace("output OUT\n", "output OUT, output [1:0] STATE\n")
    gateware = loaded(tmp_path, text.replace("endmodule", "assign STATE = LEDS[3:2];\nendmodule"))
    assert gateware.pins[:-1] == PINS
    assert (gateware.pins[-1], gateware.pins[-1].width) == ("STATE", 2)
    assert gateware.notices == ("counter.v: pin STATE leads nowhere on the board; traces show it",)
