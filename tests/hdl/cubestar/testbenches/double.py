"""Two SRAMs in turn: the camera fills one while the bus has the other."""

import random

from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.camera import picture
from cubestack.hdl.contract.bench.testbench import checked_test
from tests.hdl.cubestar.next_version import DoubleTestbench
from tests.hdl.cubestar.testbenches.bus import works_on


async def fills(bench: DoubleTestbench, memory: int) -> None:
    content = picture()
    await bench.begin(memory, content)
    assert await bench.acknowledged(memory), "no ACK"
    await bench.mcu.set(RNW=1)
    assert bench.stored(memory) == content
    await Timer(1, unit="ns")
    assert not int(bench.dut.ACK.value)


@checked_test(DoubleTestbench)
async def one_memory_serves_both_in_turn(bench: DoubleTestbench) -> None:
    """The other one has failed: it is never written, read or selected."""
    good = random.getrandbits(1)
    failed = getattr(bench.dut, f"SRAM{2 - good}_CE_N")
    for _ in range(3):
        await fills(bench, good)
        await works_on(bench, 20, good)
        assert int(failed.value)


@checked_test(DoubleTestbench)
async def standby_turns_all_off(bench: DoubleTestbench) -> None:
    await bench.begin(random.getrandbits(1), picture())
    await bench.camera.reach(len(bench.camera.clocks) + random.randrange(20))
    await bench.check()
    await bench.open()
    await fills(bench, 1)
