"""Testbench of the pair of FPGAs: two cameras, two SRAMs, one microcontroller."""

import random
from functools import partial
from itertools import product
from types import SimpleNamespace
from typing import Any, ClassVar, Self

import cocotb
from cocotb.triggers import Timer

from cubestack.hdl.contract.bench.camera import Camera, flat, lines, vsync
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Tick
from cubestack.hdl.contract.bench.processor import Processor
from cubestack.hdl.contract.bench.sram import UNKNOWN, Sram
from cubestack.hdl.contract.bench.testbench import Testbench
from cubestack.hdl.contract.bench.timing import ANY, ODD, Timing, wait
from cubestack.hdl.contract.bench.watching import Levels, levels, never_high, watch
from tests.hdl.coverage import cubesense as coverage
from tests.hdl.cubesense.reference import (
    MCU_ADDRESSING,
    NOT_FOUND,
    READ_OUT,
    SIDES,
    Controls,
    Half,
    behaviour,
)

Place = tuple[str, str]  #: Camera and memory

PREFIXES = {"sun": "SUN", "nadir": "NAD"}
OTHER = {"sun": "nadir", "nadir": "sun"}

#: The outputs in standby. The SRAMs' strobes are low active.
STANDBY = {
    **dict.fromkeys(("SUNACK", "NADACK", "DATA", "DATA_OE", "CONTENTION"), 0),
    **{
        f"{prefix}_SRAM_{name}": level
        for prefix in PREFIXES.values()
        for name, level in {"A": 0, "D_O": 0, "D_OE": 0, "CE_N": 1, "OE_N": 1, "WE_N": 1}.items()
    },
    **{
        f"{side}.{name}": 0
        for side in SIDES
        for name in ("LINK_D_O", "LINK_D_OE", "LINK_C_O", "LINK_C_OE")
    },
}


def gap() -> list[Tick]:
    return list(vsync(READ_OUT.frame_gap + random.randint(1, 9)))


def frame(content: bytes) -> list[Tick]:
    return [*gap(), *flat(lines(content))]


def with_sun(x: int, y: int) -> bytes:
    content = bytearray(random.choices(range(200), k=GEOMETRY.pixels))
    if (x, y) != NOT_FOUND:
        start = y * GEOMETRY.columns + x
        content[start : start + 3] = bytes([200, 255, 231])
    return bytes(content)


def window_of(content: bytes, x: int, y: int) -> bytes:
    size, (left, top) = READ_OUT.window, READ_OUT.window_origin(x, y)
    starts = (row * GEOMETRY.columns + left for row in range(top, top + size))
    return b"".join(content[start:][:size] for start in starts)


def coordinates(x: int, y: int) -> bytes:
    return x.to_bytes(2, "little") + y.to_bytes(2, "little")


class CubeSenseMcu(Processor[Controls]):
    """Drives the control pins, and its data bus where that goes both ways.

    By the time of their data clocks it has the ``bytes`` that came, and what was ``sent`` on the
    bus then. At first it does not drive that: it floats at some level.
    """

    CLOCK = "CLK"
    LINES = ("SHIFT", "EDGE", "RNW", "SUNEN", "NADEN")

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        levels = dict.fromkeys(self.LINES, 0) | {"SUNEN": 1, "NADEN": 1}
        super().__init__(dut, Controls, levels, timing)
        self.bytes: dict[int, int] = {}
        self.sent: dict[int, int] = {}
        self.drives = False
        self._data: int | None = random.getrandbits(8)
        if MCU_ADDRESSING:
            dut.DATA_I.value = self._data
        dut.CLK.value = 0
        for name, level in levels.items():
            getattr(dut, name).value = level

    async def command(self, shift: int, edge: int, rnw: int, sunen: int, naden: int) -> None:
        """From standby: a row of the command table, the enables last."""
        await self.set(SHIFT=shift, EDGE=edge, RNW=rnw)
        await self._enable(SUNEN=sunen, NADEN=naden)

    async def standby(self) -> None:
        await self._enable(SUNEN=1, NADEN=1)

    async def _enable(self, **enables: int) -> None:
        if random.getrandbits(1):
            await self.set(**enables)
        else:
            for name in random.sample(sorted(enables), 2):
                await self.set(**{name: enables[name]})

    async def store(self, camera: str, memory: str) -> None:
        own = (0, 0, 0, *enables(camera))
        await self.command(*(own if camera == memory else (1, 0, int(camera != "sun"), 0, 0)))

    async def read_picture(self, side: str) -> None:
        await self.command(0, 0, 1, *enables(side))

    async def read_edge(self, sensor: str, memory: str) -> None:
        """From standby: ready to read a sensor's edge data in a memory."""
        own = (0, 1, 1, *enables(sensor))
        await self.command(*(own if sensor == memory else (1, 1, int(sensor != "sun"), 0, 0)))

    async def open_address(self, side: str) -> None:
        await self.command(0, 1, 0, *enables(side))

    async def take(self, address: bytes) -> None:
        """From taking an address, or from reading there: take one, and go on to read there."""
        await self.set(SHIFT=0)
        for byte in address:
            await wait(random.randrange(60_000), ODD)
            self.drive(byte)
            await self.clock()
        await wait(random.randrange(60_000), ODD)
        self.drive(None)
        await self.set(SHIFT=1)

    def drive(self, byte: int | None) -> None:
        """Drive the data bus; None lets go of it, at no known level."""
        self.drives, self._data = byte is not None, byte
        self._dut.DATA_I.value = UNKNOWN if byte is None else byte

    async def acknowledged(self, side: str, patience: int = 10**9) -> bool:
        return await self.sees(f"{PREFIXES[side]}ACK", patience)

    async def clock(self) -> int:
        byte = await super().clock()
        time = self.data_clocks[-1]
        self.bytes[time] = byte
        if self._data is not None:
            self.sent[time] = self._data
        return byte


def enables(side: str) -> tuple[int, int]:
    """SUNEN and NADEN for one FPGA alone."""
    return (0, 1) if side == "sun" else (1, 0)


class PairTestbench(Testbench[Place]):
    """A place is a camera and a memory.

    A ``dead_camera``'s clock stands still; a ``failed_sram`` keeps nothing, offers unknown bytes.
    """

    PLACES: ClassVar[tuple[Place, ...]] = tuple(product(SIDES, SIDES))

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        self.dut = dut
        self.mcu = CubeSenseMcu(dut, timing)
        self.cameras: dict[str, Camera] = {}
        self.srams: dict[str, Sram] = {}
        for side, prefix in PREFIXES.items():
            wired = {"PIXCLK": "PCLK", "PIXDATA": "Y", "HSYNC": "HREF"}
            pins = {name: getattr(dut, f"{prefix}_{own}") for name, own in wired.items()}
            for pin in pins.values():
                pin.value = 0
            pins["VSYNC"] = SimpleNamespace()  # not wired
            self.cameras[side] = Camera(SimpleNamespace(**pins), timing)
            self.srams[side] = Sram(dut, f"{prefix}_SRAM_", partial(self._storing_clock, side))
        self.dead_camera = self.failed_sram = ""
        self._before = [bytes(self.srams[side].memory) for side in SIDES]
        self._ack: dict[str, Levels] = {side: [(0, 0)] for side in SIDES}

    def _storing_clock(self, side: str) -> int:
        """What writes an FPGA's memory: its own camera's, or the other one's."""
        storing = OTHER[side] if int(self.dut.SHIFT.value) else side
        return int(getattr(self.dut, f"{PREFIXES[storing]}_PCLK").value)

    @classmethod
    async def start(
        cls, dut: Any, timing: Timing = ANY, *, dead_camera: str = "", failed_sram: str = ""
    ) -> Self:
        bench = cls(dut, timing)
        bench.dead_camera, bench.failed_sram = dead_camera, failed_sram
        await Timer(1, unit="ns")
        assert levels(dut, STANDBY) == STANDBY
        for side, prefix in PREFIXES.items():
            if side == failed_sram:
                getattr(dut, f"{prefix}_SRAM_D_I").value = UNKNOWN
            else:
                bench.srams[side].start()
            cocotb.start_soon(watch(getattr(dut, f"{prefix}ACK"), bench._ack[side]))
            if side == dead_camera:
                getattr(dut, f"{prefix}_PCLK").value = random.getrandbits(1)
                getattr(dut, f"{prefix}_HREF").value = random.getrandbits(1)
            else:
                cocotb.start_soon(bench.cameras[side].run())
        cocotb.start_soon(never_high(dut.CONTENTION, "two drivers on one wire"))
        both = "the microcontroller and an FPGA drive the data bus"
        cocotb.start_soon(never_high(dut.DATA_OE, both, unless=lambda: not bench.mcu.drives))
        return bench

    def camera_of(self, place: Place) -> Camera:
        return self.cameras[place[0]]

    def memory_of(self, place: Place) -> tuple[Sram, int]:
        return self.srams[place[1]], 0

    def frame(self, content: bytes) -> list[Tick]:
        return frame(content)

    async def command(self, place: Place) -> None:
        await self.mcu.store(*place)

    async def acknowledged(self, place: Place, patience: int | None = None) -> bool:
        limit = self.patience(place) if patience is None else patience
        return await self.mcu.acknowledged(place[1], limit)

    def patience(self, place: Place) -> int:
        return super().patience(place) + 8 * READ_OUT.frame_gap * self.camera_of(place).period

    async def standby(self) -> None:
        await self.mcu.standby()

    async def fetch(self, place: Place) -> bytes:
        return await self.read(place[1], GEOMETRY.pixels)

    async def read(self, memory: str, count: int) -> bytes:
        """From standby to standby: a memory's picture, ``count`` bytes from its start on."""
        await self.mcu.read_picture(memory)
        content = await self.mcu.read(count)
        await self.standby()
        return content

    async def read_edge(self, sensor: str, memory: str, count: int) -> bytes:
        """From standby to standby: a sensor's edge data in a memory."""
        await self.mcu.read_edge(sensor, memory)
        data = await self.mcu.read(count)
        await self.standby()
        return data

    def content(self, side: str) -> bytes:
        return self.srams[side].picture()

    async def cameras_are_done(self) -> None:
        for camera in self.cameras.values():
            await camera.sent()

    async def check(self) -> dict[str, Half]:
        """Go to standby; compare memories, write pulses, ACKs and bytes with the reference."""
        await self.standby()
        await Timer(1, unit="ns")
        assert levels(self.dut, STANDBY) == STANDBY
        clocks = {side: self.cameras[side].clocks for side in SIDES}
        mcu, cameras = self.mcu, [*clocks.values()]
        halves, data = behaviour(self._before, cameras, mcu.controls, mcu.data_clocks, mcu.sent)
        for side, half in halves.items():
            sram = self.srams[side]
            assert sram.pulses == half.pulses, side
            assert (sram.edges, sram.memory) == (len(half.pulses), half.memory), side
            assert self._ack[side] == half.ack, side
        assert mcu.bytes == {time: data.get(time, 0) for time in mcu.bytes}
        coverage.sample(halves, clocks, mcu.controls, mcu.data_clocks)
        return halves
