"""Testbenches of the boards for the next version: SRAMs on the processor's external bus."""

import random
from types import SimpleNamespace
from typing import Any, ClassVar, NamedTuple

import cocotb

from cubestack.hdl.contract.bench.geometry import GEOMETRY
from cubestack.hdl.contract.bench.sram import Sram
from cubestack.hdl.contract.bench.timing import ANY, Timing
from cubestack.hdl.contract.bench.watching import never_high
from tests.hdl.cubestar.board import CubeStarTestbench
from tests.hdl.harness.bus import Ebi

MEMORY = GEOMETRY.bank_size


class Window(NamedTuple):
    """A memory on the bus: ``size`` bytes of it from ``base`` on, behind a chip select."""

    memory: int
    base: int
    size: int
    select: str


class BusTestbench(CubeStarTestbench):
    WINDOWS: ClassVar[tuple[Window, ...]]
    SELECTS: ClassVar[tuple[str, ...]] = ("CS_N",)
    QUIET = ("AD_LOW_OE",)

    def __init__(self, dut: Any, mcus: list[Any], timing: Timing = ANY) -> None:
        super().__init__(dut, mcus, timing)
        self.bus = Ebi(dut, *self.SELECTS, timing=timing)
        self.bus.situation = self._situation

    def watch(self) -> None:
        self.bus.start()

    def place_of(self, address: int, select: str) -> int:
        return address // MEMORY

    def _situation(self, address: int, select: str) -> tuple[int, str]:
        place, storing = self.place_of(address, select), self.storing()
        if not self.control(place).controls[-1].enable:
            return place, "standby"
        if place in storing:
            return place, "stores there"
        return place, "stores elsewhere" if storing else "has the bus"

    def pixel_clock(self, memory: int) -> int:
        """Low while the bus may write."""
        stores = any(self.memory_of(place)[0] is self.srams[memory] for place in self.storing())
        return super().pixel_clock(memory) if stores else 0

    def window(self, place: int) -> Window:
        return next(w for w in self.WINDOWS if self.srams[w.memory] is self.memory_of(place)[0])

    async def open(self, place: int = 0) -> None:
        await self.control(place).open(random.getrandbits(1))

    async def open_all(self) -> None:
        for place in range(len(self.mcus)):
            await self.open(place)

    def any_spot(self, *memories: int) -> tuple[Sram, int, int, str]:
        """A byte: its memory (one of those), its place there, its address and chip select."""
        window = random.choice([w for w in self.WINDOWS if not memories or w.memory in memories])
        position = random.randrange(window.size)
        return self.srams[window.memory], position, window.base + position, window.select

    async def fetch(self, place: int) -> bytes:
        await self.open(place)
        _, base, _, select = self.window(place)
        addresses = GEOMETRY.addresses(self.memory_of(place)[1])
        content = [await self.bus.read(base + address, select) for address in addresses]
        await self.control(place).standby()
        return bytes(byte for byte in content if byte is not None)


class SharedTestbench(BusTestbench):
    """The board of option 2: one SRAM for camera and bus. A place is a bank."""

    TOP = "shared"
    LOW = ("ENABLE", "RNW", "BANK")
    QUIET = ("AD_LOW_OE", "ACK", "AD_LOW_O", "SRAM_D_O")
    WINDOWS = (Window(0, 0, 2 * MEMORY, ""),)

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        super().__init__(dut, [dut], timing)
        (self.sram,) = self.srams

    def storing(self) -> set[int]:
        return {self.mcu.controls[-1].bank} if self.mcu.storing else set()


class DoubleTestbench(BusTestbench):
    """The board of option 3: the bus has the SRAM that is not filled. A place is a memory."""

    TOP = "double"
    LOW = ("ENABLE", "RNW", "INTO")
    QUIET = ("AD_LOW_OE", "ACK", "AD_LOW_O")
    MEMORIES = ("SRAM1_", "SRAM2_")
    WINDOWS = (Window(0, 0, MEMORY, ""), Window(1, MEMORY, MEMORY, ""))

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        names = ("ENABLE", "RNW", "ACK")
        pins = SimpleNamespace(**{name: getattr(dut, name) for name in names}, BANK=dut.INTO)
        super().__init__(dut, [pins], timing)
        self._into = 0  # from when RNW fell last

    def storing(self) -> set[int]:
        return {self._into} if self.mcu.storing else set()

    async def command(self, place: int) -> None:
        if not self.mcu.controls[-1].enable:
            await self.open()
        await self.mcu.set(BANK=place)
        self._into = place
        await self.mcu.set(RNW=0)

    async def store(self, place: int) -> None:
        await self.command(place)
        await self.mcu.set(BANK=random.getrandbits(1))
        await self.camera.started()


class BoardsTestbench(BusTestbench):
    """Two boards of option 2 on one bus and one camera. A place is a board."""

    TOP = "boards"
    MEMORIES = ("BOARD1_SRAM_", "BOARD2_SRAM_")
    SELECTS = ("BOARD1_CS_N", "BOARD2_CS_N")
    WINDOWS = tuple(Window(n, 0, 2 * MEMORY, select) for n, select in enumerate(SELECTS))

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        boards = []
        for board in ("BOARD1_", "BOARD2_"):
            pins = {name: getattr(dut, board + name) for name in ("ENABLE", "RNW", "BANK")}
            for pin in pins.values():
                pin.value = 0
            boards.append(SimpleNamespace(**pins, ACK=getattr(dut, f"{board}ACK")))
        super().__init__(dut, boards, timing)

    def watch(self) -> None:
        super().watch()
        cocotb.start_soon(never_high(self.dut.CONTENTION, "both boards drive the bus"))

    def place_of(self, address: int, select: str) -> int:
        return self.SELECTS.index(select)
