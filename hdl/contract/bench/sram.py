"""Behavioural model of the asynchronous SRAM, on the pins of the board's top."""

import random
from collections.abc import Callable
from typing import Any

import cocotb
from cocotb.triggers import Event, FallingEdge, First, ReadOnly, Timer
from cocotb.types import LogicArray

from cubestack.hdl.contract.bench.geometry import GEOMETRY, Pulse
from cubestack.hdl.contract.bench.timing import SLOWEST_ACCESS, now

UNKNOWN = LogicArray("X" * 8)

OUTPUTS = ("A", "D_O", "D_OE", "CE_N", "OE_N", "WE_N")  #: An SRAM's pins that the FPGA drives


class Sram:
    """Two banks of one byte a pixel; what was never written is random.

    Everything is judged when a point in time has settled: the write pulse with its address and
    data, and who drives the bus. ``edges`` counts the write pulses that the pin made at all.
    """

    def __init__(self, dut: Any, prefix: str, clock: Callable[[], int]) -> None:
        """On the pins that begin with ``prefix``; ``clock`` is the level of the writing one."""
        self._pins = {name: getattr(dut, f"{prefix}{name}") for name in (*OUTPUTS, "D_I")}
        self._pins["D_I"].value = 0
        self._prefix = prefix
        self._clock = clock
        self.memory = bytearray(random.randbytes(2 * GEOMETRY.bank_size))
        self.access = random.randrange(1, SLOWEST_ACCESS)
        self.pulses: list[Pulse] = []
        self.edges = 0
        self._pulse: Pulse | None = None
        self._judged = -1
        self._changed = Event()

    def start(self) -> None:
        for name in OUTPUTS:
            cocotb.start_soon(self._watch(self._pins[name]))
        cocotb.start_soon(self._count_edges())
        cocotb.start_soon(self._offer())

    def picture(self, bank: int = 0) -> bytes:
        return bytes(self.memory[address] for address in GEOMETRY.addresses(bank))

    def _level(self, name: str) -> int:
        value = self._pins[name].value
        assert value.is_resolvable, f"{self._prefix}{name} is {value}"
        return int(value)

    async def _count_edges(self) -> None:
        while True:
            await FallingEdge(self._pins["WE_N"])
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
        drives = self._level("D_OE")
        selected = not self._level("CE_N")
        writes = not self._level("WE_N")
        assert not (drives and not self._level("OE_N")), "FPGA and SRAM both drive the bus"
        if self._pulse is not None and not writes:
            self.memory[self._pulse.address] = self._pulse.value
            self.pulses.append(self._pulse._replace(end=now()))
            self._pulse = None
        elif writes:
            assert drives, "write pulse without data"
            assert selected, "write pulse without chip enable"
            assert not self._clock(), "write pulse in the high half of PIXCLK"
            address, value = self._level("A"), self._level("D_O")
            if self._pulse is None:
                self._pulse = Pulse(now(), 0, address, value)
            assert (address, value) == self._pulse[2:], "address or data moved in the write pulse"

    async def _offer(self) -> None:
        """Drive the data bus: unknown until the access time after a change is over."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            await Timer(1, unit="step")
            self._pins["D_I"].value = UNKNOWN
            if self._level("CE_N") or self._level("OE_N"):
                continue
            await First(Timer(self.access, unit="step"), self._changed.wait())
            if not self._changed.is_set():
                self._pins["D_I"].value = self.memory[self._level("A")]
