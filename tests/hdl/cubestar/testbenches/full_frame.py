"""One frame of the real size; see full_frame.v, which does the counting."""

import random
from typing import Any

import cocotb
from cocotb.triggers import First, RisingEdge, Timer

from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.watching import levels


@cocotb.test()
async def next_frame_is_stored_and_read_back(dut: Any) -> None:
    bank = random.getrandbits(1)
    dut.bank_wanted.value = dut.BANK.value = bank
    await Timer(random.randrange(10**6), unit="ns")
    joined = int(dut.frame.value)
    dut.ENABLE.value = 1
    await First(RisingEdge(dut.ACK), Timer(200, unit="ms"))
    await Timer(random.randrange(10**6), unit="ns")  # the camera goes on; no pulse may follow
    expected = {
        **{"ACK": 1, "ack_delay": 0, "ack_pulses": GEOMETRY.pixels, "pulses": GEOMETRY.pixels},
        "ack_frame": joined + 2,  # the camera is in the frame after that
    }
    assert levels(dut, expected) == expected
    dut.ENABLE.value = 0

    dut.expected.value = joined + 1
    dut.look.value = 1
    await Timer(1, unit="ns")
    assert int(dut.wrong_in_memory.value) == 0

    dut.RNW.value = 1
    await Timer(1, unit="us")
    dut.ENABLE.value = 1
    await Timer(1, unit="us")
    dut.read.value = 1
    await RisingEdge(dut.read_done)
    none = dict.fromkeys(("wrong_in_data", "disorder", "unstable", "contention"), 0)
    assert levels(dut, none) == none
