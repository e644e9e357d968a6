"""The nadir scan and a whole picture over the bus; see i2c_full_frame.v, which has the master."""

from fractions import Fraction
from typing import Any

import cocotb
import i2c_times
from cocotb.triggers import RisingEdge, Timer

from cubesense_fpga_i2c.register_table import ADDRESSES, GROUP_ADDRESS, command_byte
from cubestack.firmware_model.interface.cubesense.fpga import Action, Actions
from cubestack.hdl.contract.bench.timing import now
from tests.hdl.cubesense.reference import READ_OUT

PERIOD_PS = 10**6


async def request(dut: Any, kind: str, **values: int) -> Fraction:
    """One transfer; how many SCL periods it took."""
    for name, value in values.items():
        getattr(dut, name).value = value
    await Timer(1, unit="us")
    before = now()
    getattr(dut, kind).value = 1
    await RisingEdge(dut.done)
    taken = now() - before
    getattr(dut, kind).value = 0
    await Timer(1, unit="us")
    assert int(dut.refused.value) == int(dut.wrong.value) == 0
    return Fraction(taken, PERIOD_PS)


@cocotb.test()
async def scan_and_picture(dut: Any) -> None:
    await Timer(1, unit="us")
    dut.RESET_N.value = 1
    dut.quarter.value = PERIOD_PS // 4
    dut.group.value, dut.target.value = GROUP_ADDRESS, ADDRESSES["nadir"]
    read = command_byte(Actions(Action.STANDBY, Action.READ))
    assert await request(dut, "command", value=read) == i2c_times.COMMAND
    scan = Fraction(0)
    for y in READ_OUT.scan_rows:
        scan += await request(dut, "read", x=0, y=y, down=0, count=READ_OUT.columns)
    for x in READ_OUT.scan_columns:
        scan += await request(dut, "read", x=x, y=0, down=1, count=READ_OUT.rows)
    assert scan == i2c_times.scan()
    picture = await request(dut, "read", x=0, y=0, down=0, count=READ_OUT.pixels)
    assert picture == i2c_times.PICTURE
    print(f"scan {float(scan)} periods, picture {float(picture)} periods, at {PERIOD_PS} ps")
