"""A microcontroller that drives a board's control pins, and reads byte by byte or by its bus."""

import random
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Generic, TypeVar

import cocotb

from tests.hdl.coverage import cubestar as cover_cubestar
from tests.hdl.coverage.points import hit
from tests.hdl.harness.reference import GEOMETRY
from tests.hdl.harness.sram import UNKNOWN
from tests.hdl.harness.timing import ANY, ODD, SLOWEST_ACCESS, Timing, between, now, wait
from tests.hdl.harness.watching import never_high

C = TypeVar("C")


class Processor(Generic[C]):
    """Drives the control pins at random moments of its own; ``CLOCK`` is the data clock's pin.

    ``controls`` are the pins' levels, each with the time (ps) from which on it has them,
    ``data_clocks`` the times of the data clock's rising edges.
    """

    CLOCK: ClassVar[str]

    def __init__(
        self, dut: Any, record: Callable[..., C], levels: Mapping[str, int], timing: Timing = ANY
    ) -> None:
        """Control the pins that ``levels`` names, which have these levels now."""
        self._dut = dut
        self._timing = timing
        self._record = record
        self._levels = dict(levels)
        self._moved = 0  # when the SRAM's address may have changed last
        self.controls: list[C] = [record(now(), *self._levels.values())]
        self.data_clocks: list[int] = []

    async def set(self, after: int | None = None, **levels: int) -> None:
        """Drive pins together, ``after`` ps or after a random idle time."""
        await wait(between(self._timing.idles) if after is None else after, ODD)
        for name, level in levels.items():
            getattr(self._dut, name).value = level
        self._moved = now()
        self._levels.update(levels)
        self.controls.append(self._record(now(), *self._levels.values()))

    async def sees(self, ack: str, patience: int = 10**9) -> bool:
        """Poll a pin for at most ``patience`` ps."""
        limit = now() + patience
        while not int(getattr(self._dut, ack).value):
            if now() > limit:
                return False
            await wait(random.randrange(300_000), ODD)
        return True

    async def clock(self) -> int:
        """One data clock, after the SRAM's access time; the byte it presents."""
        await wait(
            max(between(self._timing.data_halves), self._moved + SLOWEST_ACCESS + 2 - now()), ODD
        )
        pin = getattr(self._dut, self.CLOCK)
        pin.value = 1
        self._moved = now()
        self.data_clocks.append(now())
        await wait(between(self._timing.data_halves), ODD)
        pin.value = 0
        return int(self._dut.DATA.value)

    async def read(self, count: int) -> bytes:
        return bytes([await self.clock() for _ in range(count)])


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
