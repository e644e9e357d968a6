"""Testbench of the pair: two cameras, two SRAMs, a microcontroller; own memories only."""

import os
import random
from typing import Any, ClassVar, NamedTuple, Self

import cocotb
from cocotb.triggers import RisingEdge, Timer

from cubestack.firmware_model.interface.cubesense.pins import PREFIXES
from cubestack.hdl.contract.bench.camera import Camera, flat, line, vsync
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Tick
from cubestack.hdl.contract.bench.processor import Processor
from cubestack.hdl.contract.bench.sram import Sram
from cubestack.hdl.contract.bench.timing import Timing, now
from cubestack.hdl.contract.bench.watching import never_high

LATENCY = 5  #: pixel clocks after which a design has followed a change of the control lines

#: Clocks of low HREF that mark a new frame; a design's parameter.
FRAME_GAP = int(os.environ.get("FRAME_GAP", "858"))

REAL = Timing(
    pixel_periods=(74_000, 100_000),
    stall_rates=(0.0,),
    data_halves=(200_000, 400_000),
    idles=(500_000, 2_000_000),
)

SIDES = tuple(map(str, PREFIXES))
_PREFIX = {str(side): prefix for side, prefix in PREFIXES.items()}
INACTIVE = {"SRAM_D_OE": 0, "SRAM_CE_N": 1, "SRAM_OE_N": 1, "SRAM_WE_N": 1}


class Lines(NamedTuple):
    """Levels of the microcontroller's lines, from ``time`` (ps) on."""

    time: int
    shift: int
    edge: int
    rnw: int
    sunen: int
    naden: int

    def enabled(self, side: str) -> bool:
        return not (self.sunen if side == SIDES[0] else self.naden)


class Mcu(Processor[Lines]):
    """Drives the command lines; the enables are active low."""

    CLOCK: ClassVar[str] = "CLK"

    def __init__(self, dut: Any, timing: Timing) -> None:
        levels = {"SHIFT": 0, "EDGE": 0, "RNW": 0, "SUNEN": 1, "NADEN": 1}
        super().__init__(dut, Lines, levels, timing)
        dut.CLK.value = 0
        for name, level in levels.items():
            getattr(dut, name).value = level


class _CameraPins:
    """A side's camera as the pins of the camera's model; VSYNC is not wired."""

    def __init__(self, dut: Any, prefix: str) -> None:
        self.PIXCLK, self.PIXDATA, self.HSYNC = (
            getattr(dut, prefix + name) for name in ("PCLK", "Y", "HREF")
        )
        for pin in (self.PIXCLK, self.PIXDATA, self.HSYNC):
            pin.value = 0
        self.VSYNC = _Unwired()


class _Unwired:
    value = 0


class PairBench:
    """``whole`` are the images that a side may acknowledge at present."""

    def __init__(self, dut: Any, timing: Timing = REAL) -> None:
        self.dut = dut
        self.mcu = Mcu(dut, timing)
        self.cameras = {
            side: Camera(_CameraPins(dut, prefix), timing) for side, prefix in _PREFIX.items()
        }
        self.srams = {
            side: Sram(dut, f"{prefix}SRAM_", lambda: 0) for side, prefix in _PREFIX.items()
        }
        self.whole: dict[str, list[bytes]] = {side: [] for side in SIDES}

    @classmethod
    async def start(cls, dut: Any, cameras: bool = True) -> Self:
        bench = cls(dut)
        if cameras:
            for camera in bench.cameras.values():
                cocotb.start_soon(camera.run())
            await bench.cameras[SIDES[0]].reach(2 * LATENCY)
            await bench.cameras[SIDES[1]].reach(2 * LATENCY)
        await Timer(1, unit="ns")
        bench.in_standby()
        cocotb.start_soon(never_high(dut.CONTENTION, "two FPGAs drive one wire"))
        for side in SIDES:
            bench.srams[side].start()
            cocotb.start_soon(bench._judge_ack(side))
            cocotb.start_soon(bench._judge_writes(side))
        return bench

    def pin(self, side: str, name: str) -> Any:
        return getattr(self.dut, _PREFIX[side] + name)

    def ack(self, side: str) -> Any:
        return getattr(self.dut, f"{_PREFIX[side].rstrip('_')}ACK")

    def in_standby(self) -> None:
        pins = {f"{_PREFIX[s]}{name}": level for s in SIDES for name, level in INACTIVE.items()}
        acks = {f"{_PREFIX[side].rstrip('_')}ACK": 0 for side in SIDES}
        for name, level in {**pins, **acks, "DATA_OE": 0}.items():
            value = getattr(self.dut, name).value
            assert value.is_resolvable, f"in standby {name} is {value}, neither 0 nor 1"
            assert int(value) == level, f"in standby {name} is {int(value)}"

    def _stores(self, side: str) -> bool:
        lines = self.mcu.controls[-1]
        return lines.enabled(side) and not (lines.rnw or lines.edge or lines.shift)

    def _changing(self) -> bool:
        slowest = max(camera.period for camera in self.cameras.values())
        return now() - self.mcu.controls[-1].time < LATENCY * slowest

    async def _judge_ack(self, side: str) -> None:
        while True:
            await RisingEdge(self.ack(side))
            await Timer(1, unit="step")
            if not int(self.ack(side).value) or self._changing():
                continue
            assert self._stores(side), f"the {side} ACK rises though it does not store"
            stored = self.srams[side].picture()
            assert stored in self.whole[side], f"the {side} ACK is early: no whole frame is stored"

    async def _judge_writes(self, side: str) -> None:
        addresses, seen = {*GEOMETRY.addresses()}, 0
        while True:
            await RisingEdge(self.pin(side, "SRAM_WE_N"))
            await Timer(1, unit="step")
            pulses = self.srams[side].pulses[seen:]
            seen += len(pulses)
            for pulse in pulses:
                stores = self._stores(side) or self._changing()
                assert stores, f"a write to the {side} memory while it is not stored in"
                assert pulse.address in addresses, f"a write at {pulse.address:#x}, outside"

    # --- actions ---

    async def command(self, side: str, *, rnw: int) -> None:
        self.whole[side] = []
        await self.mcu.set(SHIFT=0, EDGE=0, RNW=rnw)
        await self.mcu.set(**{"SUNEN" if side == SIDES[0] else "NADEN": 0})

    async def store(self, side: str) -> None:
        await self.command(side, rnw=0)
        camera = self.cameras[side]
        await camera.reach(len(camera.clocks) + 2 * LATENCY)

    async def standby(self) -> None:
        await self.mcu.set(SUNEN=1, NADEN=1)
        slowest = max(camera.period for camera in self.cameras.values())
        await Timer(LATENCY * slowest + 1000, unit="step")
        self.in_standby()

    def rows(self, content: bytes) -> list[Tick]:
        """A pause that marks a frame, then rows."""
        size = GEOMETRY.columns
        starts = range(0, len(content), size)
        pauses = min(8, FRAME_GAP - 1)
        return [
            *vsync(FRAME_GAP + 2 * LATENCY),
            *flat(line(content[start : start + size], pauses) for start in starts),
        ]

    async def shoot(self, side: str) -> bytes:
        content = random.randbytes(GEOMETRY.pixels)
        await self.store(side)
        self.whole[side].append(content)
        self.cameras[side].send(self.rows(content))
        await self.cameras[side].sent()
        period = self.cameras[side].period
        name = f"{_PREFIX[side].rstrip('_')}ACK"
        assert await self.mcu.sees(name, 2 * LATENCY * period), f"no {side} ACK"
        await self.standby()
        assert self.srams[side].picture() == content, "the memory changed after ACK"
        return content

    async def read_back(self, side: str, count: int) -> None:
        expected = self.srams[side].picture()[:count]
        await self.command(side, rnw=1)
        found = await self.mcu.read(count)
        await self.standby()
        for number, (byte, wanted) in enumerate(zip(found, expected, strict=True), 1):
            assert byte == wanted, f"data clock {number} presents {byte:#04x}, not {wanted:#04x}"
