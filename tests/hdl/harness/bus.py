"""A microcontroller's external bus."""

import random
from collections.abc import Callable
from typing import Any

import cocotb

from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.sram import UNKNOWN
from cubestack.hdl.contract.bench.timing import ANY, ODD, SLOWEST_ACCESS, Timing, between, wait
from cubestack.hdl.contract.bench.watching import never_high
from tests.hdl.coverage import cubestar as cover_cubestar
from tests.hdl.coverage.points import hit

#: Address bits that some memory uses: memory or bank, row, column.
USED_BITS = GEOMETRY.position_bits + 1


class Ebi:
    """Bus master, 24 address and 8 data bits. Lines not driven are unknown; unused bits random."""

    def __init__(self, dut: Any, *selects: str, timing: Timing = ANY) -> None:
        self._dut = dut
        self._timing = timing
        self._selects = selects or ("CS_N",)
        self.drives = True
        #: Memory of an access to an address with a chip select, and what the board is at.
        self.situation: Callable[[int, str], tuple[int, str]] | None = None
        for name in (*self._selects, "RE_N", "WE_N"):
            getattr(dut, name).value = 1
        for name in ("AD_HIGH", "AD_LOW_I", "ALE"):
            getattr(dut, name).value = 0

    def start(self) -> None:
        both = "two drivers on AD_LOW"
        cocotb.start_soon(never_high(self._dut.AD_LOW_OE, both, unless=lambda: not self.drives))

    async def address(self, address: int) -> None:
        address |= random.getrandbits(24 - USED_BITS) << USED_BITS
        self.drives = True
        self._dut.AD_HIGH.value = random.getrandbits(8)  # ALE does not wait for the lines
        self._dut.AD_LOW_I.value = random.getrandbits(8)
        self._dut.ALE.value = 1
        await self._pause()
        self._dut.AD_HIGH.value, self._dut.AD_LOW_I.value = address >> 16, address >> 8 & 0xFF
        await self._pause()
        self._dut.ALE.value = 0
        await self._pause()
        self._dut.AD_HIGH.value = address & 0xFF

    async def write(self, address: int, value: int, select: str = "") -> None:
        self._note("write", address, select)
        await self.address(address)
        self._dut.AD_LOW_I.value = value
        await self._strobe("WE_N", select)

    async def read(self, address: int, select: str = "") -> int | None:
        self._note("read", address, select)
        await self.address(address)
        self._dut.AD_LOW_I.value = UNKNOWN
        self.drives = False
        byte = await self._strobe("RE_N", select)
        self.drives = True
        self._dut.AD_LOW_I.value = random.getrandbits(8)
        return byte

    async def read_and_write(self, address: int, select: str = "") -> int:
        """Both strobes in one access, which a processor never makes; the byte that comes.

        RE_N falls first and rises last: of pins that move together the order is the simulator's.
        """
        await self.address(address)
        self.drives = False
        pins = [getattr(self._dut, name) for name in ("RE_N", "WE_N", select or self._selects[0])]
        for pin in pins:
            pin.value = 0
            await wait(1_000, ODD)
        await wait(SLOWEST_ACCESS + between(self._timing.pauses), ODD)
        byte = int(self._dut.AD_LOW_O.value)
        for pin in reversed(pins):
            pin.value = 1
            await wait(1_000, ODD)
        await self._pause()
        self.drives = True
        return byte

    def _note(self, access: str, address: int, select: str) -> None:
        if self.situation is not None and cover_cubestar.TOP is not None:
            memory, board = self.situation(address, select)
            hit("bus", top=cover_cubestar.TOP, access=access, memory=memory, board=board)

    async def _strobe(self, strobe: str, select: str) -> int | None:
        chip = getattr(self._dut, select or self._selects[0])
        chip.value = 0
        await self._pause()
        getattr(self._dut, strobe).value = 0
        await wait(SLOWEST_ACCESS + between(self._timing.pauses), ODD)
        driven = int(self._dut.AD_LOW_OE.value)
        byte = int(self._dut.AD_LOW_O.value) if driven else None
        getattr(self._dut, strobe).value = 1
        await self._pause()
        chip.value = 1
        await self._pause()
        return byte

    async def _pause(self) -> None:
        await wait(between(self._timing.pauses), ODD)
