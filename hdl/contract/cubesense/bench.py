"""Testbench of the pair: two cameras, two SRAMs, a microcontroller."""

import random
from itertools import cycle, islice
from typing import Any, ClassVar, NamedTuple, Self

import cocotb
from cocotb.triggers import RisingEdge, Timer

from cubestack.firmware_model.interface.cubesense.fpga import COMMANDS, Action, Actions, actions
from cubestack.firmware_model.interface.cubesense.pins import PREFIXES
from cubestack.hdl.contract.bench.camera import Camera, flat, line, vsync
from cubestack.hdl.contract.bench.geometry import GEOMETRY, Tick
from cubestack.hdl.contract.bench.processor import Processor
from cubestack.hdl.contract.bench.sram import Sram
from cubestack.hdl.contract.bench.timing import Timing, now
from cubestack.hdl.contract.bench.watching import never_high
from cubestack.hdl.contract.contract import Size
from cubestack.hdl.contract.cubesense.sizes import read_out

LATENCY = 5  #: pixel clocks after which a design has followed a change of the control lines

READ_OUT = read_out(Size(*GEOMETRY))

#: Clocks between two rows: fewer than mark a new frame.
PAUSE = min(8, READ_OUT.frame_gap - 1)

REAL = Timing(
    pixel_periods=(74_000, 100_000),
    stall_rates=(0.0,),
    data_halves=(200_000, 400_000),
    idles=(500_000, 2_000_000),
)

SIDES = tuple(map(str, PREFIXES))
OTHER = dict(zip(SIDES, reversed(SIDES), strict=True))
_PREFIX = {str(side): prefix for side, prefix in PREFIXES.items()}
_INACTIVE = {"SRAM_D_OE": 0, "SRAM_CE_N": 1, "SRAM_OE_N": 1, "SRAM_WE_N": 1}


class Place(NamedTuple):
    """A camera, and the side whose memory its image is stored in."""

    camera: str
    memory: str

    @property
    def way(self) -> str:
        return "own" if self.camera == self.memory else "other"


PLACES = tuple(Place(camera, memory) for memory in SIDES for camera in SIDES)


class Lines(NamedTuple):
    """Levels of the microcontroller's lines, from ``time`` (ps) on."""

    time: int
    shift: int
    edge: int
    rnw: int
    sunen: int
    naden: int

    @property
    def actions(self) -> Actions:
        return actions(*self[1:])


def row(**wanted: Action) -> tuple[int, ...]:
    """Levels of the first row of the command table in which the sides take these actions."""
    for command in COMMANDS:
        if all(getattr(command.actions, side) is action for side, action in wanted.items()):
            return tuple(int(level or 0) for level in command.levels)
    raise ValueError(f"no row has {wanted}")


def store_row(place: Place) -> tuple[int, ...]:
    return row(**{place.memory: Action.STORE if place.way == "own" else Action.STORE_OTHER})


def edge_row(place: Place) -> tuple[int, ...]:
    """Of the edge data of a camera's image."""
    return row(**{place.memory: Action.EDGE if place.way == "own" else Action.SEND_EDGE})


class Mcu(Processor[Lines]):
    """Drives the command lines; the enables are active low."""

    CLOCK: ClassVar[str] = "CLK"

    def __init__(self, dut: Any, timing: Timing) -> None:
        levels = {"SHIFT": 0, "EDGE": 0, "RNW": 0, "SUNEN": 1, "NADEN": 1}
        super().__init__(dut, Lines, levels, timing)
        dut.CLK.value = 0
        for name, level in levels.items():
            getattr(dut, name).value = level

    async def command(self, levels: tuple[int, ...], after: int | None = None) -> None:
        """From standby to a row of the table, the enables at last, in any order or together.

        They follow ``after`` ps, together, or after random times.
        """
        await self.set(**dict(zip(("SHIFT", "EDGE", "RNW"), levels, strict=False)))
        enables = dict(zip(("SUNEN", "NADEN"), levels[3:], strict=True))
        if after is not None or random.getrandbits(1):
            await self.set(after, **enables)
            return
        for name in random.sample(sorted(enables), 2):
            await self.set(**{name: enables[name]})


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
    """``whole`` are the images that a memory's side may acknowledge at present."""

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
    async def start(cls, dut: Any, cameras: tuple[str, ...] = SIDES) -> Self:
        """In standby; a camera that is not among ``cameras`` gives no pixel clock."""
        bench = cls(dut)
        for side in cameras:
            cocotb.start_soon(bench.cameras[side].run())
        for side in cameras:
            await bench.cameras[side].reach(2 * LATENCY)
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

    def ack_name(self, side: str) -> str:
        return f"{_PREFIX[side].rstrip('_')}ACK"

    def ack(self, side: str) -> Any:
        return getattr(self.dut, self.ack_name(side))

    def in_standby(self) -> None:
        pins = {f"{_PREFIX[s]}{name}": level for s in SIDES for name, level in _INACTIVE.items()}
        acks = {self.ack_name(side): 0 for side in SIDES}
        for name, level in {**pins, **acks, "DATA_OE": 0}.items():
            value = getattr(self.dut, name).value
            assert value.is_resolvable, f"in standby {name} is {value}, neither 0 nor 1"
            assert int(value) == level, f"in standby {name} is {int(value)}"

    def stored(self, side: str) -> bytes:
        return self.srams[side].picture()

    # --- monitors ---

    def _stores(self, side: str) -> bool:
        action = getattr(self.mcu.controls[-1].actions, side)
        return action in (Action.STORE, Action.STORE_OTHER)

    @property
    def latency(self) -> int:
        """In ps."""
        return LATENCY * max(camera.period for camera in self.cameras.values())

    def _changing(self) -> bool:
        return now() - self.mcu.controls[-1].time < self.latency

    async def _judge_ack(self, side: str) -> None:
        while True:
            await RisingEdge(self.ack(side))
            await Timer(1, unit="step")
            if not int(self.ack(side).value) or self._changing():
                continue
            assert self._stores(side), f"the {side} ACK rises though it does not store"
            stored = self.stored(side) in self.whole[side]
            assert stored, f"the {side} ACK is early: no whole frame is stored"

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

    async def store(self, *places: Place) -> None:
        """From standby to storing, and long enough for any design to be ready."""
        for place in places:
            self.whole[place.memory] = []
        own = {place.memory: Action.STORE for place in places}
        await self.mcu.command(row(**own) if len(places) > 1 else store_row(places[0]))
        for place in places:
            camera = self.cameras[place.camera]
            await camera.reach(len(camera.clocks) + 2 * LATENCY)

    async def standby(self) -> None:
        await self.mcu.set(SUNEN=1, NADEN=1)
        await Timer(self.latency + 1000, unit="step")
        self.in_standby()

    def rows(self, content: bytes, gap: int = READ_OUT.frame_gap + 2 * LATENCY) -> list[Tick]:
        """A pause that marks a frame, then rows."""
        size = GEOMETRY.columns
        starts = range(0, len(content), size)
        return [*vsync(gap), *flat(line(content[start : start + size], PAUSE) for start in starts)]

    def frame(self, place: Place, content: bytes) -> list[Tick]:
        """A whole frame, which may be acknowledged from now on."""
        self.whole[place.memory].append(content)
        return self.rows(content)

    async def sends(self, place: Place, ticks: list[Tick]) -> None:
        self.cameras[place.camera].send(ticks)
        await self.cameras[place.camera].sent()

    async def acknowledged(self, place: Place) -> bool:
        """A few clocks after the camera has sent all."""
        return await self.mcu.sees(self.ack_name(place.memory), 2 * self.latency)

    async def is_stored(self, place: Place) -> None:
        assert await self.acknowledged(place), f"no {place.memory} ACK"
        await self.standby()

    async def shoot(self, place: Place, content: bytes | None = None) -> bytes:
        content = random.randbytes(GEOMETRY.pixels) if content is None else content
        await self.store(place)
        await self.sends(place, self.frame(place, content))
        await self.is_stored(place)
        assert self.stored(place.memory) == content, "the memory changed after ACK"
        return content

    async def presents(self, levels: tuple[int, ...], expected: bytes) -> None:
        """From standby to standby: the data clocks present these bytes."""
        await self.mcu.command(levels)
        for number, wanted in enumerate(expected, 1):
            found = await self.mcu.clock()
            assert int(self.dut.DATA_OE.value), f"data clock {number}: no FPGA drives DATA"
            wrong = f"data clock {number} presents {found:#04x}, not {wanted:#04x}"
            assert found == wanted, wrong
        await Timer(self.latency, unit="step")
        assert int(self.dut.DATA.value) == expected[-1], "DATA changes without a data clock"
        await self.standby()

    async def read_back(self, side: str, count: int) -> None:
        await self.presents(row(**{side: Action.READ}), self.stored(side)[:count])

    def scan(self, memory: str, further: int) -> bytes:
        """The nadir scan, and bytes beyond its end; its presets present the first pixel."""
        content, columns = self.stored(memory), GEOMETRY.columns
        order = [(0, 0) if pixel is None else pixel for pixel in READ_OUT.scan()]
        columns_again = order[-len(READ_OUT.scan_columns) * GEOMETRY.rows :]
        again = islice(cycle(columns_again), further)
        return bytes(content[y * columns + x] for x, y in [*order, *again])

    def window(self, memory: str, x: int, y: int, further: int) -> bytes:
        """The Sun window, and bytes beyond its end."""
        content, columns = self.stored(memory), GEOMETRY.columns
        left, top = READ_OUT.window_origin(x, y)
        size = READ_OUT.window
        pixels = [content[(top + n // size) * columns + left + n % size] for n in range(size**2)]
        coordinates = x.to_bytes(2, "little") + y.to_bytes(2, "little")
        return coordinates + bytes([*pixels, *islice(cycle(pixels), further)])
