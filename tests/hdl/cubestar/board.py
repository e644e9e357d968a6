"""Testbench of the boards of CubeStar: one camera, SRAMs, and processors with control pins."""

import random
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar, Self

import cocotb
from cocotb.triggers import Timer

from tests.hdl.coverage import cubestar as coverage
from tests.hdl.harness.camera import Camera, frame
from tests.hdl.harness.processor import Processor
from tests.hdl.harness.reference import GEOMETRY, Behaviour, Controls, Pulse, Tick, behaviour
from tests.hdl.harness.sram import Sram
from tests.hdl.harness.testbench import Testbench
from tests.hdl.harness.timing import ANY, EVEN, Timing
from tests.hdl.harness.watching import Levels, levels, watch


class Mcu(Processor[Controls]):
    """Drives ENABLE, RNW and BANK, or their equivalents on ``dut``."""

    CLOCK = "DCLK"

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        super().__init__(dut, Controls, {"ENABLE": 0, "RNW": 0, "BANK": 0}, timing)

    @property
    def storing(self) -> bool:
        return bool(self._levels["ENABLE"] and not self._levels["RNW"])

    async def store(self, bank: int = 0) -> None:
        await self.set(BANK=bank)
        if random.random() < 0.5:
            await self.set(RNW=0)
        await self.set(RNW=0, ENABLE=1)

    async def acknowledged(self, patience: int = 10**9) -> bool:
        return await self.sees("ACK", patience)

    async def open(self, bank: int = 0) -> None:
        """From standby: make ready to read, byte by byte or on the bus."""
        await self.set(BANK=bank, RNW=1)
        await self.set(ENABLE=1)

    async def standby(self) -> None:
        await self.set(ENABLE=0)


class CubeStarTestbench(Testbench[int]):
    """A place is a bank, a memory or a board, by its number; ``mcus`` drive the control pins.

    ``TOP`` is the name in the declared coverage, ``MEMORIES`` what the names of each memory's pins
    begin with, ``LOW`` the inputs besides the camera's that are low at first, and ``QUIET`` the
    outputs that are 0 in standby besides the memories'.
    """

    PLACES: ClassVar[tuple[int, ...]] = (0, 1)
    TOP: ClassVar[str]
    MEMORIES: ClassVar[tuple[str, ...]] = ("SRAM_",)
    LOW: ClassVar[tuple[str, ...]] = ()
    QUIET: ClassVar[tuple[str, ...]] = ()

    def __init__(self, dut: Any, mcus: Sequence[Any], timing: Timing = ANY) -> None:
        """``mcus``: the pins of each processor."""
        self.dut = dut
        for name in (*self.LOW, "PIXCLK", "PIXDATA", "HSYNC", "VSYNC"):
            getattr(dut, name).value = 0
        self.camera = Camera(dut, timing)
        self.mcus = [Mcu(pins, timing) for pins in mcus]
        self.srams = [
            Sram(dut, prefix, lambda n=n: self.pixel_clock(n))
            for n, prefix in enumerate(self.MEMORIES)
        ]
        self._acks: list[tuple[Any, Levels]] = [(pins.ACK, [(0, 0)]) for pins in mcus]

    @classmethod
    async def start(cls, dut: Any, timing: Timing = ANY) -> Self:
        bench = await cls.without_camera(dut, timing)
        cocotb.start_soon(bench.camera.run())
        return bench

    @classmethod
    async def without_camera(cls, dut: Any, timing: Timing = ANY) -> Self:
        bench = cls(dut, timing=timing)  # type: ignore[call-arg]
        await Timer(1, unit="ns")
        bench.in_standby()
        for sram in bench.srams:
            sram.start()
        for signal, seen in bench._acks:
            cocotb.start_soon(watch(signal, seen))
        bench.watch()
        return bench

    def watch(self) -> None: ...

    def in_standby(self) -> None:
        """AssertionError unless all outputs have their levels of standby; but for the bank."""
        expected = self.standby_levels()
        assert levels(self.dut, expected) == expected
        for sram in self.MEMORIES:
            address = getattr(self.dut, f"{sram}A").value[GEOMETRY.position_bits - 1 : 0]
            assert int(address) == 0, "all but the bank, which is retained from power-up on"

    @classmethod
    def standby_levels(cls) -> dict[str, int]:
        """The outputs in standby, without the addresses. The SRAMs' strobes are low active."""
        strobes = {"D_OE": 0, "CE_N": 1, "OE_N": 1, "WE_N": 1}
        pins = {f"{sram}{name}": strobes[name] for sram in cls.MEMORIES for name in strobes}
        return pins | dict.fromkeys(cls.QUIET, 0)

    @property
    def mcu(self) -> Mcu:
        (mcu,) = self.mcus
        return mcu

    def control(self, place: int) -> Mcu:
        return self.mcus[place % len(self.mcus)]

    def storing(self) -> set[int]:
        return {place for place in self.PLACES if self.control(place).storing}

    def pixel_clock(self, memory: int) -> int:
        """The level of the clock that write pulses of a memory have to keep to."""
        return int(self.dut.PIXCLK.value)

    def camera_of(self, place: int) -> Camera:
        return self.camera

    def memory_of(self, place: int) -> tuple[Sram, int]:
        return self.srams[place % len(self.srams)], place // len(self.srams)

    def frame(self, content: bytes) -> list[Tick]:
        return frame(content)

    async def command(self, place: int) -> None:
        await self.control(place).store(place // len(self.mcus))

    async def acknowledged(self, place: int, patience: int | None = None) -> bool:
        limit = self.patience(place) if patience is None else patience
        return await self.control(place).acknowledged(limit)

    async def standby(self) -> None:
        for mcu in self.mcus:
            await mcu.standby()

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
