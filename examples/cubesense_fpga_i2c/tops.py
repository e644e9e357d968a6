"""The designs with their clocks, by the names that the command line uses."""

from functools import partial
from pathlib import Path

from cubesense_fpga_i2c.pair import CubeSenseI2cPair
from cubesense_fpga_i2c.pointer import MemoryPointer
from cubesense_fpga_i2c.register_table import ADDRESSES, GROUP_ADDRESS
from cubesense_fpga_i2c.registers import CubeSenseI2cRegisters
from cubesense_fpga_i2c.target import I2cTarget
from cubesense_fpga_i2c.top import CubeSenseI2cFpga
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.hdl.cubesense.dataflow import SIDES, Side
from cubestack.hdl.cubesense.tops import LINK_CLOCK, PIXEL_CLOCK
from cubestack.hdl.flow.top import Block, Clock, Top, TopTable

_SCL = Clock("SCL", 1000, "I2C at 1 MHz, both edges")
_SDA = Clock("SDA", 1000, "I2C's START and STOP, both edges")


def _fpga(side: Side) -> Top:
    return Top(
        partial(CubeSenseI2cFpga, side),
        f"CubeSense, {side} sensor's FPGA on an I2C bus",
        (PIXEL_CLOCK, LINK_CLOCK, _SCL, _SDA),
        pulled_up=("SCL", "SDA", "LINK_C"),
        reset="RESET_N low",
    )


#: Their tracked area.
AREA_FILE = Path(__file__).parent / "area.json"

TOPS: TopTable = {
    **{f"cubesense-{side}-i2c": _fpga(side) for side in SIDES},
    "cubesense-pair-i2c": Top(
        CubeSenseI2cPair,
        "CubeSense, model of both FPGAs, their link and their I2C bus",
        (*(PIXEL_CLOCK._replace(port=f"{half}_PCLK") for half in ("SUN", "NAD")), _SCL),
        parts=2,
        reset="RESET_N low",
    ),
    "I2C target": Block(partial(I2cTarget, ADDRESSES["sun"], GROUP_ADDRESS)),
    "memory pointer": Block(partial(MemoryPointer, FULL_SIZE)),
    "I2C registers with these two": Block(partial(CubeSenseI2cRegisters, "sun", FULL_SIZE)),
}
