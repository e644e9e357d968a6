"""One frame of full size on any design; full_frame.v is around it and does the counting."""

import random
from typing import Any

from cocotb.triggers import First, RisingEdge, Timer

from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.watching import levels
from cubestack.hdl.contract.cubestar.points import hit
from cubestack.hdl.contract.testing import contract_test


@contract_test(timeout_ms=1500)
async def stores_and_reads_a_whole_frame(dut: Any) -> None:
    """The next frame is in the memory when ACK rises, and comes back byte by byte."""
    bank = random.getrandbits(1)
    dut.bank_wanted.value = dut.BANK.value = bank
    await Timer(random.randrange(10**6), unit="ns")
    dut.ENABLE.value = 1
    await First(RisingEdge(dut.ACK), Timer(400, unit="ms"))
    assert int(dut.ACK.value), "no ACK"
    frame, row = int(dut.frame.value), int(dut.row.value)
    # Without a frame's last row the camera is still in that frame.
    dut.expected.value = frame - 1 if row < GEOMETRY.rows // 2 else frame
    dut.look.value = 1
    await Timer(1, unit="ns")
    missing = int(dut.wrong_in_memory.value)
    assert not missing, f"ACK is early: {missing} pixels are not in the memory"
    count = int(dut.pulses.value)
    await Timer(random.randrange(10**6), unit="ns")
    assert int(dut.pulses.value) == count, "a write after ACK"
    _counted(dut, "disorder", "unstable", "contention")
    hit("image", bank=bank, done="stored")

    dut.ENABLE.value = 0
    await Timer(1, unit="us")
    dut.RNW.value = 1
    await Timer(1, unit="us")
    dut.ENABLE.value = 1
    await Timer(1, unit="us")
    dut.read.value = 1
    await RisingEdge(dut.read_done)
    _counted(dut, "wrong_in_data", "contention")
    hit("image", bank=bank, done="read")


WORDS = {
    "disorder": "{} writes at a wrong address",
    "unstable": "{} times address or data moved in a write pulse",
    "contention": "{} times FPGA and SRAM drove the bus together",
    "wrong_in_data": "{} data clocks presented a wrong byte",
}


def _counted(dut: Any, *names: str) -> None:
    found = levels(dut, names)
    wrong = [WORDS[name].format(count) for name, count in found.items() if count]
    assert not wrong, "; ".join(wrong)
