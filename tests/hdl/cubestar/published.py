"""Testbench of the published board, which is read byte by byte with a data clock."""

from typing import Any

import cocotb

from tests.hdl.coverage import cubestar as coverage
from tests.hdl.cubestar.board import CubeStarTestbench
from tests.hdl.harness.geometry import GEOMETRY
from tests.hdl.harness.reference import Behaviour, behaviour
from tests.hdl.harness.timing import ANY, Timing
from tests.hdl.harness.watching import Levels, watch


class PublishedTestbench(CubeStarTestbench):
    TOP = "published"
    LOW = ("ENABLE", "RNW", "BANK", "DCLK")
    QUIET = ("ACK", "DATA", "SRAM_D_O")

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        super().__init__(dut, [dut], timing)
        (self.sram,) = self.srams
        self._before = bytes(self.sram.memory)
        self._data: Levels = [(0, 0)]

    def watch(self) -> None:
        cocotb.start_soon(watch(self.dut.DATA, self._data))

    def stored(self, place: int = 0) -> bytes:
        return super().stored(place)

    async def store(self, place: int = 0) -> None:
        await super().store(place)

    async def fetch(self, place: int) -> bytes:
        await self.mcu.open(place)
        content = await self.mcu.read(GEOMETRY.pixels)
        await self.standby()
        return content

    async def check(self) -> Behaviour:
        """Go to standby and compare every pin and the memory with the reference, to the ps."""
        await self.settle_in_standby()
        clocks, mcu = self.camera.clocks, self.mcu
        expected = behaviour(GEOMETRY, self._before, clocks, mcu.controls, mcu.data_clocks)
        assert self.sram.pulses == expected.pulses
        assert self._acks[0][1] == expected.ack
        assert self._data == expected.data
        assert self.sram.memory == expected.memory
        coverage.sample(clocks, self.camera.period, mcu.controls, mcu.data_clocks)
        return expected
