"""Behavioural model of the asynchronous SRAM, on the pins of the board's top."""

import random
from typing import Any

import cocotb
from cocotb.triggers import Event, FallingEdge, First, ReadOnly, Timer
from cocotb.types import LogicArray
from geometry import Geometry
from instants import now
from reference import Pulse

UNKNOWN = LogicArray("X" * 8)

#: Longest time in ps from an address to its byte. The real part is quicker than this.
SLOWEST_ACCESS = 12_000


class Sram:
    """Two banks of one byte a pixel; what was never written is random.

    Everything is judged when a point in time has settled: the write pulse with its address and
    data, and who drives the bus. ``edges`` counts the write pulses that the pin made at all.
    """

    def __init__(self, dut: Any, geometry: Geometry) -> None:
        self._dut = dut
        self.memory = bytearray(random.randbytes(2 * geometry.bank_size))
        self.access = random.randrange(1, SLOWEST_ACCESS)
        self.pulses: list[Pulse] = []
        self.edges = 0
        self._pulse: Pulse | None = None
        self._judged = -1
        self._changed = Event()

    def start(self) -> None:
        for name in ("SRAM_A", "SRAM_D_O", "SRAM_D_OE", "SRAM_CE_N", "SRAM_OE_N", "SRAM_WE_N"):
            cocotb.start_soon(self._watch(getattr(self._dut, name)))
        cocotb.start_soon(self._count_edges())
        cocotb.start_soon(self._offer())

    def _level(self, name: str) -> int:
        return int(getattr(self._dut, name).value)

    async def _count_edges(self) -> None:
        while True:
            await FallingEdge(self._dut.SRAM_WE_N)
            self.edges += 1

    async def _watch(self, signal: Any) -> None:
        while True:
            await signal.value_change
            await ReadOnly()
            if now() != self._judged:
                self._judged = now()
                self._judge()
                self._changed.set()

    def _judge(self) -> None:
        drives = self._level("SRAM_D_OE")
        selected = not self._level("SRAM_CE_N")
        writes = not self._level("SRAM_WE_N")
        assert not (drives and not self._level("SRAM_OE_N")), "FPGA and SRAM both drive the bus"
        if self._pulse is not None and not writes:
            self.memory[self._pulse.address] = self._pulse.value
            self.pulses.append(self._pulse._replace(end=now()))
            self._pulse = None
        elif writes:
            assert drives, "write pulse without data"
            assert selected, "write pulse without chip enable"
            assert not self._level("PIXCLK"), "write pulse in the high half of PIXCLK"
            address, value = self._level("SRAM_A"), self._level("SRAM_D_O")
            if self._pulse is None:
                self._pulse = Pulse(now(), 0, address, value)
            assert (address, value) == self._pulse[2:], "address or data moved in the write pulse"

    async def _offer(self) -> None:
        """Drive the data bus: unknown until the access time after a change is over."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            await Timer(1, unit="step")
            self._dut.SRAM_D_I.value = UNKNOWN
            if self._level("SRAM_CE_N") or self._level("SRAM_OE_N"):
                continue
            await First(Timer(self.access, unit="step"), self._changed.wait())
            if not self._changed.is_set():
                self._dut.SRAM_D_I.value = self.memory[self._level("SRAM_A")]
