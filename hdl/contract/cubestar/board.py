"""Testbench of CubeStar's boards: one camera, SRAMs, and processors with control pins."""

import random
from collections.abc import Sequence
from functools import partial
from typing import Any, ClassVar, NamedTuple, Self

import cocotb
from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.camera import Camera, frame
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Tick
from cubestack.hdl.contract.bench.processor import Processor
from cubestack.hdl.contract.bench.sram import Sram
from cubestack.hdl.contract.bench.testbench import Testbench
from cubestack.hdl.contract.bench.timing import ANY, Timing
from cubestack.hdl.contract.bench.watching import Levels, levels, watch


class Controls(NamedTuple):
    """Levels that the microcontroller drives, from ``time`` (ps) on."""

    time: int
    enable: int
    rnw: int
    bank: int


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


class CubeStarBench(Testbench[int]):
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
            Sram(dut, prefix, partial(self.pixel_clock, n))
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
