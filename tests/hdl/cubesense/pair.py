"""Bench of the pair of FPGAs: two cameras, two SRAMs, one microcontroller, and the scoreboard."""

import random
from itertools import product
from types import SimpleNamespace
from typing import Any, ClassVar

import cocotb
import cover_pair
from bench import Camera, flat, lines, patience, vsync
from cocotb.triggers import ReadOnly, Timer
from geometry import GEOMETRY
from instants import ODD, now, wait
from pair_reference import SIDES, Controls, Half, behaviour
from reference import Tick
from small import MCU_ADDRESSING, READ_OUT
from sram import SLOWEST_ACCESS, UNKNOWN, Sram
from timing import ANY, Timing

PREFIXES = {"sun": "SUN", "nadir": "NAD"}
OTHER = {"sun": "nadir", "nadir": "sun"}

#: The outputs in standby. The SRAMs' strobes are low active.
STANDBY = {
    "SUNACK": 0,
    "NADACK": 0,
    "DATA": 0,
    "DATA_OE": 0,
    "CONTENTION": 0,
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


def pin(dut: Any, path: str) -> Any:
    """A port of the pair, or of one of its FPGAs."""
    for name in path.split("."):
        dut = getattr(dut, name)
    return dut


def levels(dut: Any) -> dict[str, int]:
    """All outputs, as in ``STANDBY``."""
    return {name: int(pin(dut, name).value) for name in STANDBY}


def frame(content: bytes) -> list[Tick]:
    """A gap between frames, then all lines."""
    return [*vsync(READ_OUT.frame_gap + random.randint(1, 9)), *flat(lines(content))]


class StoringClock:
    """The clock that writes an FPGA's memory: its own camera's, or the other one's."""

    def __init__(self, dut: Any, side: str) -> None:
        self._dut = dut
        self._clocks = [getattr(dut, f"{PREFIXES[s]}_PCLK") for s in (side, OTHER[side])]

    @property
    def value(self) -> Any:
        return self._clocks[int(self._dut.SHIFT.value)].value


class CubeSenseMcu:
    """Drives the control pins at random moments of its own; the record is in the two lists."""

    LINES = ("SHIFT", "EDGE", "RNW", "SUNEN", "NADEN")

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        self._dut = dut
        self._timing = timing
        self._moved = 0  # when an SRAM's address may have changed last
        self._levels = dict.fromkeys(self.LINES, 0) | {"SUNEN": 1, "NADEN": 1}
        self.controls = [Controls(now(), *self._levels.values())]
        self.bytes: dict[int, int] = {}  # by the time of their clock
        self.sent: dict[int, int] = {}  # what is on its data bus then
        self.drives = False  # its data bus; at first that floats at some level
        self._data: int | None = random.getrandbits(8)
        if MCU_ADDRESSING:
            dut.DATA_I.value = self._data
        dut.CLK.value = 0
        for name, level in self._levels.items():
            getattr(dut, name).value = level

    async def set(self, after: int | None = None, **pins: int) -> None:
        """Drive pins together, ``after`` ps or after a random idle time."""
        await wait(self._timing.idle() if after is None else after, ODD)
        for name, level in pins.items():
            getattr(self._dut, name).value = level
        self._moved = now()
        self._levels.update(pins)
        self.controls.append(Controls(now(), *self._levels.values()))

    async def command(self, shift: int, edge: int, rnw: int, sunen: int, naden: int) -> None:
        """From standby: a row of the command table, the enables last."""
        await self.set(SHIFT=shift, EDGE=edge, RNW=rnw)
        enables = {"SUNEN": sunen, "NADEN": naden}
        if random.getrandbits(1):
            await self.set(**enables)
        else:
            for name in random.sample(sorted(enables), 2):
                await self.set(**{name: enables[name]})

    async def standby(self) -> None:
        """From anywhere."""
        if random.getrandbits(1):
            await self.set(SUNEN=1, NADEN=1)
        else:
            for name in random.sample(["SUNEN", "NADEN"], 2):
                await self.set(**{name: 1})

    async def store(self, side: str) -> None:
        """From standby: own camera to own memory."""
        await self.command(0, 0, 0, *enables(side))

    async def store_linked(self, camera: str) -> None:
        """From standby: a camera's picture to the other one's memory."""
        await self.command(1, 0, 0 if camera == "sun" else 1, 0, 0)

    async def read_picture(self, side: str) -> None:
        """From standby: ready to read a memory's picture."""
        await self.command(0, 0, 1, *enables(side))

    async def read_edge(self, side: str) -> None:
        """From standby: ready to read a sensor's edge data in its own memory."""
        await self.command(0, 1, 1, *enables(side))

    async def read_edge_linked(self, sensor: str) -> None:
        """From standby: ready to read a sensor's edge data in the other one's memory."""
        await self.command(1, 1, 0 if sensor == "sun" else 1, 0, 0)

    async def open_address(self, side: str) -> None:
        """From standby: ready to take an address."""
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
        """Poll an FPGA's ACK for at most ``patience`` ps."""
        ack = getattr(self._dut, f"{PREFIXES[side]}ACK")
        limit = now() + patience
        while not int(ack.value):
            if now() > limit:
                return False
            await wait(random.randrange(300_000), ODD)
        return True

    async def clock(self) -> int:
        """One data clock, after the SRAM's access time; the byte it presents."""
        await wait(max(self._timing.data_half(), self._moved + SLOWEST_ACCESS + 2 - now()), ODD)
        self._dut.CLK.value = 1
        time = self._moved = now()
        if self._data is not None:
            self.sent[time] = self._data
        await wait(self._timing.data_half(), ODD)
        self._dut.CLK.value = 0
        self.bytes[time] = int(self._dut.DATA.value)
        return self.bytes[time]

    async def read(self, count: int) -> bytes:
        return bytes([await self.clock() for _ in range(count)])


def enables(side: str) -> tuple[int, int]:
    """SUNEN and NADEN for one FPGA alone."""
    return (0, 1) if side == "sun" else (1, 0)


class PairBench:
    """The pair with all that surrounds it. ``start`` it, use it, ``check`` it."""

    #: Camera and memory.
    PLACES: ClassVar[tuple[tuple[str, str], ...]] = tuple(product(SIDES, SIDES))

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        self.dut = dut
        self.mcu = CubeSenseMcu(dut, timing)
        self.cameras: dict[str, Camera] = {}
        self.srams: dict[str, Sram] = {}
        for side, prefix in PREFIXES.items():
            for name in ("Y", "HREF", "PCLK", "SRAM_D_I"):
                getattr(dut, f"{prefix}_{name}").value = 0
            pins = SimpleNamespace(
                PIXCLK=getattr(dut, f"{prefix}_PCLK"),
                PIXDATA=getattr(dut, f"{prefix}_Y"),
                HSYNC=getattr(dut, f"{prefix}_HREF"),
                VSYNC=SimpleNamespace(),  # not wired
            )
            self.cameras[side] = Camera(pins, timing)
            names = ("A", "D_I", "D_O", "D_OE", "CE_N", "OE_N", "WE_N")
            memory = {f"SRAM_{name}": getattr(dut, f"{prefix}_SRAM_{name}") for name in names}
            self.srams[side] = Sram(
                SimpleNamespace(**memory, PIXCLK=StoringClock(dut, side)), GEOMETRY
            )
        self.dead_camera = self.failed_sram = ""
        self._before = [bytes(self.srams[side].memory) for side in SIDES]
        self._ack: dict[str, list[tuple[int, int]]] = {side: [(0, 0)] for side in SIDES}

    @classmethod
    async def start(
        cls, dut: Any, timing: Timing = ANY, *, dead_camera: str = "", failed_sram: str = ""
    ) -> "PairBench":
        """In standby, with both cameras' clocks running, but for a dead one, which stands still.

        A failed SRAM keeps nothing and offers unknown bytes.
        """
        bench = cls(dut, timing)
        bench.dead_camera, bench.failed_sram = dead_camera, failed_sram
        await Timer(1, unit="ns")
        assert levels(dut) == STANDBY
        for side in SIDES:
            if side == failed_sram:
                getattr(dut, f"{PREFIXES[side]}_SRAM_D_I").value = UNKNOWN
            else:
                bench.srams[side].start()
            cocotb.start_soon(bench._watch_ack(side))
            if side == dead_camera:
                getattr(dut, f"{PREFIXES[side]}_PCLK").value = random.getrandbits(1)
                getattr(dut, f"{PREFIXES[side]}_HREF").value = random.getrandbits(1)
            else:
                cocotb.start_soon(bench.cameras[side].run())
        cocotb.start_soon(bench._watch_contention())
        cocotb.start_soon(bench._watch_data_bus())
        return bench

    async def _watch_ack(self, side: str) -> None:
        ack, seen = getattr(self.dut, f"{PREFIXES[side]}ACK"), self._ack[side]
        while True:
            await ack.value_change
            await ReadOnly()
            if int(ack.value) != seen[-1][1]:
                seen.append((now(), int(ack.value)))

    async def _watch_contention(self) -> None:
        while True:
            await self.dut.CONTENTION.value_change
            await ReadOnly()
            assert not int(self.dut.CONTENTION.value), "two drivers on one wire"

    async def _watch_data_bus(self) -> None:
        while True:
            await self.dut.DATA_OE.value_change
            await ReadOnly()
            both = self.mcu.drives and int(self.dut.DATA_OE.value)
            assert not both, "the microcontroller and an FPGA drive the data bus"

    async def begin(self, place: tuple[str, str], content: bytes) -> None:
        camera, memory = place
        if camera == memory:
            await self.mcu.store(camera)
        else:
            await self.mcu.store_linked(camera)
        # Reset's two clocks, and one more.
        await self.cameras[camera].reach(len(self.cameras[camera].clocks) + 3)
        self.cameras[camera].send(frame(content))

    async def acknowledged(self, place: tuple[str, str]) -> bool:
        camera, memory = place
        limit = (
            patience(self.cameras[camera]) + 8 * READ_OUT.frame_gap * self.cameras[camera].period
        )
        return await self.mcu.acknowledged(memory, limit)

    async def standby(self) -> None:
        await self.mcu.standby()

    async def fetch(self, place: tuple[str, str]) -> bytes:
        _, memory = place
        await self.mcu.read_picture(memory)
        content = await self.mcu.read(GEOMETRY.pixels)
        await self.mcu.standby()
        return content

    async def shoot(self, camera: str, memory: str, content: bytes) -> None:
        """From standby: one picture from a camera to a memory, to ACK, and to standby."""
        await self.begin((camera, memory), content)
        assert await self.acknowledged((camera, memory))
        await self.mcu.standby()
        assert self.stored(memory) == content

    def stored(self, side: str) -> bytes:
        """A memory's picture, row by row."""
        rows, columns = range(GEOMETRY.rows), range(GEOMETRY.columns)
        memory = self.srams[side].memory
        return bytes(memory[GEOMETRY.address(x, y)] for y in rows for x in columns)

    async def check(self) -> dict[str, Half]:
        """Go to standby; compare memories, write pulses, ACKs and bytes with the reference."""
        await self.mcu.standby()
        await Timer(1, unit="ns")
        assert levels(self.dut) == STANDBY
        halves, data = behaviour(
            self._before,
            [self.cameras[side].clocks for side in SIDES],
            self.mcu.controls,
            list(self.mcu.bytes),
            self.mcu.sent,
        )
        for side, half in halves.items():
            assert self.srams[side].pulses == half.pulses, side
            assert self.srams[side].edges == len(half.pulses), side
            assert self.srams[side].memory == half.memory, side
            assert self._ack[side] == half.ack, side
        assert self.mcu.bytes == {time: data.get(time, 0) for time in self.mcu.bytes}
        cover_pair.sample(
            halves,
            {side: self.cameras[side].clocks for side in SIDES},
            self.mcu.controls,
            list(self.mcu.bytes),
        )
        return halves
