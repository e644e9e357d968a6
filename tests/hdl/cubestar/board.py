"""Testbench of the boards of CubeStar with a scoreboard: everything to the picosecond."""

from collections.abc import Iterable
from typing import Any

import cocotb
from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.geometry import GEOMETRY, Pulse
from cubestack.hdl.contract.bench.timing import ANY, EVEN, Timing
from cubestack.hdl.contract.bench.watching import Levels, watch
from cubestack.hdl.contract.cubestar.board import CubeStarBench
from tests.hdl.coverage import cubestar as coverage
from tests.hdl.harness.reference import Behaviour, behaviour


class CubeStarTestbench(CubeStarBench):
    async def settle_in_standby(self) -> None:
        """Go there; each write pulse was whole, and was as the scoreboard says."""
        await self.standby()
        await Timer(1, unit="ns")
        self.in_standby()
        for sram in self.srams:
            assert sram.edges == len(sram.pulses), "a write pulse that was none"

    async def check(self) -> object:
        """ACK and the write pulses of all stores, to the ps, wherever in memory they went."""
        await self.settle_in_standby()
        clocks, memory = self.camera.clocks, bytes(2 * GEOMETRY.bank_size)
        for n, (mcu, (_, ack)) in enumerate(zip(self.mcus, self._acks, strict=True)):
            srams = self.srams if len(self.mcus) == 1 else [self.srams[n]]
            # Those that the camera's clock began are at even ps.
            own = sorted(p for sram in srams for p in sram.pulses if p.start % 2 == EVEN)
            expected = behaviour(GEOMETRY, memory, clocks, mcu.controls, ())
            assert ack == expected.ack
            assert _positions(own) == _positions(expected.pulses)
            coverage.sample(clocks, self.camera.period, mcu.controls)
        return None


def _positions(pulses: Iterable[Pulse]) -> list[Pulse]:
    return [pulse._replace(address=pulse.address % GEOMETRY.bank_size) for pulse in pulses]


class PublishedTestbench(CubeStarTestbench):
    """The published board, which is read byte by byte with a data clock."""

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
