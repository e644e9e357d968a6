"""Strobes on the bus that are meant for another chip. ``BENCH`` names the bench, as for any top."""

import random
from typing import Any

from bench import timed_test
from benches_any_top import BENCH
from cocotb.triggers import Timer
from geometry import GEOMETRY
from instants import ODD, wait
from sram import SLOWEST_ACCESS


@timed_test
async def nothing_happens_without_the_chip_select(dut: Any) -> None:
    """No memory is selected or written, and the bus is not driven."""
    bench = await BENCH.start(dut)
    await bench.standby()
    await bench.open()
    srams = bench.srams if hasattr(bench, "srams") else [bench.sram]
    before = [bytes(sram.memory) for sram in srams]
    memories = ["SRAM1_", "SRAM2_"] if len(srams) == 2 else ["SRAM_"]
    for strobe in ["RE_N", "WE_N"] * 8:
        await bench.bus.address(random.randrange(2 * GEOMETRY.bank_size))
        dut.AD_LOW_I.value = random.getrandbits(8)
        getattr(dut, strobe).value = 0
        await wait(SLOWEST_ACCESS, ODD)
        assert not int(dut.AD_LOW_OE.value)
        for memory in memories:
            assert int(getattr(dut, f"{memory}CE_N").value)
            assert int(getattr(dut, f"{memory}OE_N").value)
            assert int(getattr(dut, f"{memory}WE_N").value)
        getattr(dut, strobe).value = 1
        await Timer(1, unit="ns")
    assert [sram.memory for sram in srams] == before
    await bench.check()
