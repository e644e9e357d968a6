"""One FPGA with its twin without power: every line of the link floats."""

import os
import random
from typing import Any

from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.testbench import timed_test
from cubestack.hdl.contract.bench.watching import disturb_in_standby, levels

CONTROLS = ("RNW", "CLK", "EDGE", "SHIFT")
INPUTS = ("Y", "HREF", "PCLK", *CONTROLS, "LINK_D_I", "LINK_C_I", "SRAM_D_I")
STANDBY = {
    **dict.fromkeys(("ACK", "DATA_O", "DATA_OE", "SRAM_A", "SRAM_D_O", "SRAM_D_OE"), 0),
    **dict.fromkeys(("LINK_D_O", "LINK_D_OE", "LINK_C_O", "LINK_C_OE"), 0),
    **dict.fromkeys(("SRAM_CE_N", "SRAM_OE_N", "SRAM_WE_N"), 1),
}
OTHER_LINE = {"sun": 2, "nadir": 1}[os.environ["SIDE"]]


async def standby(dut: Any) -> None:
    dut.EN.value = 1
    for name in INPUTS:
        getattr(dut, name).value = 0
    await Timer(1, unit="ns")
    assert levels(dut, STANDBY) == STANDBY


@timed_test
async def idle_is_reset(dut: Any) -> None:
    await standby(dut)
    await disturb_in_standby(dut, STANDBY, INPUTS, (1_000,), 2000)


@timed_test
async def reads_its_memory(dut: Any) -> None:
    """A pulled-up control line says that the other FPGA is not enabled; its data are ignored."""
    await standby(dut)
    memory = random.randbytes(GEOMETRY.bank_size)
    dut.LINK_C_I.value = OTHER_LINE
    dut.RNW.value = 1
    dut.EN.value = 0
    for address in GEOMETRY.addresses():
        dut.LINK_D_I.value = random.randrange(256)
        await Timer(1, unit="ns")
        assert int(dut.SRAM_A.value) == address
        dut.SRAM_D_I.value = memory[address]
        await Timer(1, unit="ns")
        dut.CLK.value = 1
        await Timer(1, unit="ns")
        dut.CLK.value = 0
        assert int(dut.DATA_O.value) == memory[address]
    dut.LINK_C_I.value = 0
    await Timer(1, unit="ns")
    assert not int(dut.DATA_OE.value), "both enabled is no row to read in"
    await standby(dut)
