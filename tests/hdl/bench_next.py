"""Benches of the tops for the next version: camera, SRAMs and the processor's external bus."""

import random
from types import SimpleNamespace
from typing import Any, ClassVar

import cocotb
import cover_cubestar
from bench import Camera, Mcu, check_stores, frame, patience, picture, watch
from cocotb.triggers import ReadOnly, Timer
from ebi import Ebi, sram_at, stored
from geometry import GEOMETRY
from instants import ODD, wait
from timing import ANY, Timing

#: The shared-memory board's outputs in standby, without the address.
STANDBY = {
    **dict.fromkeys(("ACK", "AD_LOW_O", "AD_LOW_OE", "SRAM_D_O", "SRAM_D_OE"), 0),
    **dict.fromkeys(("SRAM_CE_N", "SRAM_OE_N", "SRAM_WE_N"), 1),
}


def addresses(start: int) -> list[int]:
    """Of a picture's pixels, row by row, in the memory or bank that starts there."""
    rows, columns = range(GEOMETRY.rows), range(GEOMETRY.columns)
    return [start + GEOMETRY.address(x, y) for y in rows for x in columns]


class SharedBench:
    """Camera, processor and SRAM around the board of option 2."""

    PLACES: ClassVar[tuple[int, ...]] = (0, 1)  # banks

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        self.dut = dut
        for name in ("ENABLE", "RNW", "BANK", "PIXCLK", "PIXDATA", "HSYNC", "VSYNC"):
            getattr(dut, name).value = 0
        self.camera = Camera(dut, timing)
        self.mcu = Mcu(dut, timing)
        self.bus = Ebi(dut, timing=timing)
        self._ack = [(0, 0)]
        self.sram = sram_at(dut, "SRAM_", lambda: not int(dut.RNW.value))
        self.bus.situation = self._situation

    def _situation(self, address: int, select: str) -> tuple[int, str]:
        bank, (_, enable, rnw, own) = address // GEOMETRY.bank_size, self.mcu.controls[-1]
        stores = "stores there" if bank == own else "stores elsewhere"
        return bank, "standby" if not enable else "has the bus" if rnw else stores

    @classmethod
    async def start(cls, dut: Any, timing: Timing = ANY) -> "SharedBench":
        bench = cls(dut, timing)
        await Timer(1, unit="ns")
        bench.in_standby()
        bench.sram.start()
        bench.bus.start()
        cocotb.start_soon(watch(dut.ACK, bench._ack))
        cocotb.start_soon(bench.camera.run())
        return bench

    def in_standby(self) -> None:
        assert {name: int(getattr(self.dut, name).value) for name in STANDBY} == STANDBY
        address = self.dut.SRAM_A.value
        assert int(address[GEOMETRY.position_bits - 1 : 0]) == 0, "all but the bank"

    def control(self, place: int) -> Mcu:
        return self.mcu

    async def command(self, place: int) -> None:
        await self.mcu.store(place)

    async def store(self, bank: int) -> None:
        """From standby to storing, in time for a frame that is sent from now on."""
        await self.command(bank)
        await self.camera.reach(len(self.camera.clocks) + 3)

    async def begin(self, place: int, content: bytes) -> None:
        await self.store(place)
        self.camera.send(frame(content))

    async def acknowledged(self, place: int) -> bool:
        return await self.mcu.acknowledged(patience(self.camera))

    async def standby(self) -> None:
        await self.mcu.standby()

    async def shoot(self, bank: int) -> bytes:
        """From standby to standby: a picture is stored."""
        content = picture()
        await self.begin(bank, content)
        assert await self.acknowledged(bank)
        await self.standby()
        assert stored(self.sram, bank) == content
        return content

    async def open(self) -> None:
        """From standby: the bus has the memory."""
        await self.mcu.set(RNW=1, BANK=random.getrandbits(1))
        await self.mcu.set(ENABLE=1)

    async def fetch(self, place: int) -> bytes:
        await self.open()
        content = [await self.bus.read(a) for a in addresses(place * GEOMETRY.bank_size)]
        await self.mcu.standby()
        return bytes(byte for byte in content if byte is not None)

    async def check(self) -> None:
        await self.mcu.standby()
        await Timer(1, unit="ns")
        self.in_standby()
        assert self.sram.edges == len(self.sram.pulses), "a write pulse that was none"
        check_stores(self.camera, self.mcu, self._ack, self.sram.pulses)
        cover_cubestar.sample(self.camera.clocks, self.camera.period, self.mcu.controls)


class DoubleBench:
    """Camera, processor and both SRAMs around the board of option 3."""

    PLACES: ClassVar[tuple[int, ...]] = (0, 1)  # memories

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        self.dut = dut
        for name in ("ENABLE", "RNW", "INTO", "PIXCLK", "PIXDATA", "HSYNC", "VSYNC"):
            getattr(dut, name).value = 0
        self.camera = Camera(dut, timing)
        pins = {name: getattr(dut, name) for name in ("ENABLE", "RNW", "ACK")}
        self.mcu = Mcu(SimpleNamespace(**pins, BANK=dut.INTO), timing)
        self.bus = Ebi(dut, timing=timing)
        self._ack = [(0, 0)]
        self.into: int | None = None  # memory that is stored in
        self.srams = [
            sram_at(dut, f"SRAM{n + 1}_", lambda n=n: self.into == n) for n in self.PLACES
        ]
        self.bus.situation = self._situation

    def _situation(self, address: int, select: str) -> tuple[int, str]:
        memory, enable = address // GEOMETRY.bank_size, self.mcu.controls[-1].enable
        stores = "stores there" if memory == self.into else "stores elsewhere"
        return memory, "standby" if not enable else "has the bus" if self.into is None else stores

    @classmethod
    async def start(cls, dut: Any, timing: Timing = ANY) -> "DoubleBench":
        """The bus has both memories, and the camera's clock runs."""
        bench = cls(dut, timing)
        await Timer(1, unit="ns")
        cocotb.start_soon(watch(dut.ACK, bench._ack))
        for sram in bench.srams:
            sram.start()
        bench.bus.start()
        cocotb.start_soon(bench.camera.run())
        await bench.open()
        return bench

    async def open(self) -> None:
        """The bus has both memories."""
        await self.mcu.set(RNW=1)
        await self.mcu.set(ENABLE=1)

    def control(self, place: int) -> Mcu:
        return self.mcu

    async def command(self, place: int) -> None:
        """From standby, or from where the bus has both."""
        if not self.mcu.controls[-1].enable:
            await self.open()
        await self.mcu.set(BANK=place)
        self.into = place
        await self.mcu.set(RNW=0)

    async def store(self, into: int) -> None:
        """To storing, in time for a frame that is sent from now on."""
        await self.command(into)
        await self.mcu.set(BANK=random.getrandbits(1))
        await self.camera.reach(len(self.camera.clocks) + 3)

    async def begin(self, place: int, content: bytes) -> None:
        await self.store(place)
        self.camera.send(frame(content))

    async def acknowledged(self, place: int) -> bool:
        return await self.mcu.acknowledged(patience(self.camera))

    async def finish(self, into: int, content: bytes) -> None:
        """To ACK, and back to the bus."""
        assert await self.acknowledged(into), "no ACK"
        await self.mcu.set(RNW=1)
        self.into = None
        assert stored(self.srams[into]) == content
        await wait(1_000, ODD)
        assert not int(self.dut.ACK.value)

    async def standby(self) -> None:
        await self.mcu.standby()
        self.into = None

    async def fetch(self, place: int) -> bytes:
        await self.open()
        content = [await self.bus.read(a) for a in addresses(place * GEOMETRY.bank_size)]
        await self.mcu.standby()
        return bytes(byte for byte in content if byte is not None)

    async def check(self) -> None:
        await self.standby()
        await Timer(1, unit="ns")
        await ReadOnly()
        low = ("ACK", "AD_LOW_O", "AD_LOW_OE", "SRAM1_A", "SRAM2_A", "SRAM1_D_OE", "SRAM2_D_OE")
        assert {name: int(getattr(self.dut, name).value) for name in low} == dict.fromkeys(low, 0)
        high = [f"SRAM{n}_{name}" for n in (1, 2) for name in ("CE_N", "OE_N", "WE_N")]
        assert {name: int(getattr(self.dut, name).value) for name in high} == dict.fromkeys(high, 1)
        assert all(sram.edges == len(sram.pulses) for sram in self.srams)
        pulses = sorted(pulse for sram in self.srams for pulse in sram.pulses)
        check_stores(self.camera, self.mcu, self._ack, pulses)
        cover_cubestar.sample(self.camera.clocks, self.camera.period, self.mcu.controls)
        await Timer(1, unit="ns")


class BoardsBench:
    """Camera, processor and both boards' SRAMs."""

    PLACES: ClassVar[tuple[int, ...]] = (0, 1)  # boards

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        self.dut = dut
        for name in ("PIXCLK", "PIXDATA", "HSYNC", "VSYNC"):
            getattr(dut, name).value = 0
        self.camera = Camera(dut, timing)
        self.bus = Ebi(dut, "BOARD1_CS_N", "BOARD2_CS_N", timing=timing)
        self.mcus, self.srams = [], []
        self._acks: list[list[tuple[int, int]]] = [[(0, 0)] for _ in self.PLACES]
        for n in self.PLACES:
            board = f"BOARD{n + 1}_"
            pins = {name: getattr(dut, board + name) for name in ("ENABLE", "RNW", "BANK")}
            for pin in pins.values():
                pin.value = 0
            ack = getattr(dut, f"{board}ACK")
            self.mcus.append(Mcu(SimpleNamespace(**pins, ACK=ack), timing))
            rnw = pins["RNW"]
            self.srams.append(sram_at(dut, f"{board}SRAM_", lambda rnw=rnw: not int(rnw.value)))
        self.bus.situation = self._situation

    def _situation(self, address: int, select: str) -> tuple[int, str]:
        board = int(select[len("BOARD")]) - 1
        own, other = (self.mcus[n].controls[-1] for n in (board, 1 - board))
        if not own.enable or not own.rnw:
            return board, "stores there" if own.enable else "standby"
        return board, "stores elsewhere" if other.enable and not other.rnw else "has the bus"

    @classmethod
    async def start(cls, dut: Any, timing: Timing = ANY) -> "BoardsBench":
        bench = cls(dut, timing)
        await Timer(1, unit="ns")
        for sram in bench.srams:
            sram.start()
        bench.bus.start()
        cocotb.start_soon(bench.camera.run())
        cocotb.start_soon(bench._watch_contention())
        for board, ack in zip((dut.BOARD1_ACK, dut.BOARD2_ACK), bench._acks, strict=True):
            cocotb.start_soon(watch(board, ack))
        return bench

    async def _watch_contention(self) -> None:
        while True:
            await self.dut.CONTENTION.value_change
            await ReadOnly()
            assert not int(self.dut.CONTENTION.value), "both boards drive the bus"

    def control(self, place: int) -> Mcu:
        return self.mcus[place]

    async def command(self, place: int) -> None:
        await self.mcus[place].store(0)

    async def store(self, board: int) -> None:
        """From standby to storing, in time for a frame that is sent from now on."""
        await self.command(board)
        await self.camera.reach(len(self.camera.clocks) + 3)

    async def begin(self, place: int, content: bytes) -> None:
        await self.store(place)
        self.camera.send(frame(content))

    async def acknowledged(self, place: int) -> bool:
        return await self.mcus[place].acknowledged(patience(self.camera))

    async def standby(self) -> None:
        for mcu in self.mcus:
            await mcu.standby()

    async def open(self, board: int) -> None:
        """From standby: the bus has the board's memory."""
        await self.mcus[board].set(RNW=1)
        await self.mcus[board].set(ENABLE=1)

    async def fetch(self, place: int) -> bytes:
        await self.open(place)
        select = f"BOARD{place + 1}_CS_N"
        content = [await self.bus.read(address, select) for address in addresses(0)]
        await self.mcus[place].standby()
        return bytes(byte for byte in content if byte is not None)

    async def check(self) -> None:
        await self.standby()
        await Timer(1, unit="ns")
        assert not int(self.dut.AD_LOW_OE.value)
        assert all(sram.edges == len(sram.pulses) for sram in self.srams)
        for mcu, sram, ack in zip(self.mcus, self.srams, self._acks, strict=True):
            check_stores(self.camera, mcu, ack, sram.pulses)
            cover_cubestar.sample(self.camera.clocks, self.camera.period, mcu.controls)
