"""Frames told apart by their gaps, against runs of HREF."""

import random
from typing import Any

import cocotb

from cubestack.hdl.contract.bench.timing import clock, some_time
from tests.hdl.cubesense.reference import READ_OUT, vsync

GAP = READ_OUT.frame_gap


async def compare(dut: Any, href: list[int]) -> None:
    await clock(dut, "pix", reset=1, href=random.getrandbits(1))
    for level, expected in zip(href, vsync(href), strict=True):
        dut.pix_clk.value = dut.pix_rst.value = 0
        dut.href.value = level
        await some_time()
        assert int(dut.vsync.value) == expected
        dut.pix_clk.value = 1
        await some_time()


@cocotb.test()
async def gap_of_every_length(dut: Any) -> None:
    for low in range(1, 2 * GAP + 3):
        await compare(dut, [1] * 3 + [0] * low + [1] * 4 + [0] * GAP + [1] + [0] * low + [1])


@cocotb.test()
async def first_frame_needs_a_gap_since_reset(dut: Any) -> None:
    for low in (GAP - 1, GAP, GAP + 1):
        await compare(dut, [0] * low + [1] * 5 + [0, 1] * 3)


@cocotb.test()
async def any_waveform(dut: Any) -> None:
    href: list[int] = []
    while len(href) < 200 * GAP:
        low = random.choice([1, GAP - 1, GAP, GAP + 1, GAP + 2, random.randint(1, 3 * GAP)])
        href += [1] * random.randint(1, GAP) + [0] * low
    assert {0, 1} == set(vsync(href))
    await compare(dut, href)
