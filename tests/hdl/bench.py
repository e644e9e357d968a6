"""Bench of the board's top: camera and microcontroller on their own clocks, SRAM, scoreboard.

Every top has a bench of the same form (:class:`Surroundings`): ``start`` it with a
:class:`~timing.Timing`, ``shoot`` a picture to one of its ``PLACES``, ``fetch`` it, ``begin`` one
and leave it at any moment with ``standby``, ``check`` the scoreboard.
"""

import random
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from operator import itemgetter
from typing import Any, ClassVar, Protocol, Self, TypeVar

import cocotb
import cover_cubestar
from cocotb.triggers import Event, ReadOnly, RisingEdge, Timer
from geometry import GEOMETRY
from instants import EVEN, ODD, now, wait
from reference import Behaviour, Clock, Controls, Pulse, Tick, behaviour
from sram import SLOWEST_ACCESS, Sram
from timing import ANY, Timing

T = TypeVar("T")

#: Decorator of a bench's tests: as `cocotb.test`, and long before this much time they are over.
timed_test = cocotb.test(timeout_time=30, timeout_unit="ms")

HOLD = SETUP = 2_000  # ps around the rising PIXCLK in which the camera's pins stand still
NEVER = 1 << 62

#: The outputs in standby, as ``outputs`` gives them. The SRAM's strobes are low active.
STANDBY = {
    "ACK": 0,
    "DATA": 0,
    "SRAM_A": 0,
    "SRAM_D_O": 0,
    "SRAM_D_OE": 0,
    "SRAM_CE_N": 1,
    "SRAM_OE_N": 1,
    "SRAM_WE_N": 1,
}


def outputs(dut: Any) -> dict[str, int]:
    """Levels of all outputs, without the bank in SRAM_A: standby retains it, from power-up on."""
    values = {name: getattr(dut, name).value for name in STANDBY}
    values["SRAM_A"] = values["SRAM_A"][GEOMETRY.position_bits - 1 : 0]
    return {name: int(value) for name, value in values.items()}


def picture() -> bytes:
    """A random picture, row by row."""
    return random.randbytes(GEOMETRY.pixels)


def line(pixels: Iterable[int], blanking: int | None = None) -> Iterator[Tick]:
    """A line's pixels, then HSYNC low for ``blanking`` clocks, or a random number of them."""
    for pixel in pixels:
        yield Tick(pixel, 1, 1)
    for _ in range(blanking or random.randint(1, 6)):
        yield Tick(random.randrange(256), 0, 1)


def vsync(clocks: int | None = None) -> Iterator[Tick]:
    """VSYNC low between two frames."""
    for _ in range(clocks or random.randint(1, 9)):
        yield Tick(random.randrange(256), 0, 0)


def lines(content: bytes, blanking: int | None = None) -> list[list[Tick]]:
    """The lines of a frame of ``GEOMETRY``."""
    size = GEOMETRY.columns
    starts = range(0, len(content), size)
    return [list(line(content[start : start + size], blanking)) for start in starts]


def flat(parts: Iterable[Iterable[T]]) -> list[T]:
    """The parts one after the other."""
    return list(chain.from_iterable(parts))


def frame(content: bytes) -> list[Tick]:
    """VSYNC low, then all lines."""
    return [*vsync(), *flat(lines(content))]


class Camera:
    """Free-running source: its rate, phase, duty cycle and stretched clocks are ``timing``'s.

    Its pins change at random between hold and set-up time.

    With nothing to send it is between two lines. ``clocks`` is the record of what it did.
    """

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        self._dut = dut
        self._queue: deque[Tick] = deque()
        self._shown = False  # the pins show a tick that was sent and not clocked yet
        self._pins = Tick(0, 0, 1)
        self._running = Event()
        self._running.set()
        self.period = timing.pixel_period()
        self.stalls = timing.stalls()
        self._phase = timing.phase(self.period)
        self._duty = timing.duty()
        self.clocks: list[Clock] = []

    @property
    def busy(self) -> bool:
        """Whether something sent was not clocked yet."""
        return bool(self._queue) or self._shown

    def send(self, ticks: Iterable[Tick]) -> None:
        self._queue.extend(ticks)

    async def begin(self, ticks: Iterable[Tick]) -> int:
        """Send right now; the index in ``clocks`` of the first of these ticks."""
        await self.sent()
        await RisingEdge(self._dut.PIXCLK)
        self.send(ticks)
        return len(self.clocks)

    async def sent(self) -> None:
        """Wait for the rising edge of the last tick sent."""
        while self.busy:
            await RisingEdge(self._dut.PIXCLK)

    async def reach(self, clocks: int) -> None:
        """Wait until so many rising edges are over."""
        while len(self.clocks) < clocks:
            await RisingEdge(self._dut.PIXCLK)

    def stop(self) -> None:
        """Stop the clock at whatever level it has."""
        self._running.clear()

    def go(self) -> None:
        self._running.set()

    async def run(self) -> None:
        self._show()
        await self._pass(self._phase)
        while True:
            self._dut.PIXCLK.value = 1
            self.clocks.append(Clock(now(), NEVER, self._pins))
            self._shown = False
            high, low = self._half(self._duty), self._half(1 - self._duty)
            change = random.randrange(HOLD, high + low - SETUP, 2)
            elapsed = 0
            for moment, act in sorted(
                [(high, self._fall), (change, self._show)], key=itemgetter(0)
            ):
                await self._pass(moment - elapsed)
                elapsed = moment
                act()
            await self._pass(high + low - elapsed)

    def _half(self, part: float) -> int:
        stretched = random.randint(2, 20) if random.random() < self.stalls else 1
        return int(self.period * part / 2) * 2 * stretched

    def _fall(self) -> None:
        self._dut.PIXCLK.value = 0
        self.clocks[-1] = self.clocks[-1]._replace(fall=now())

    def _show(self) -> None:
        self._shown = bool(self._queue)
        self._pins = self._queue.popleft() if self._shown else Tick(random.randrange(256), 0, 1)
        self._dut.PIXDATA.value, self._dut.HSYNC.value, self._dut.VSYNC.value = self._pins

    async def _pass(self, ps: int) -> None:
        await wait(ps, EVEN)
        if not self._running.is_set():
            await self._running.wait()
            await wait(random.randrange(self.period), EVEN)


def patience(camera: Camera) -> int:
    """Time in ps in which a picture of ``GEOMETRY`` is over, however often its clock stalls."""
    return 8 * (GEOMETRY.pixels + 20 * GEOMETRY.rows) * camera.period


class Mcu:
    """Drives the control pins at random moments of its own; the record is in the two lists."""

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        self._dut = dut
        self._timing = timing
        self._moved = 0  # when the SRAM's address may have changed last
        self._levels = {"ENABLE": 0, "RNW": 0, "BANK": 0}
        self.controls = [Controls(now(), 0, 0, 0)]
        self.data_clocks: list[int] = []

    async def set(self, after: int | None = None, **levels: int) -> None:
        """Drive pins together, ``after`` ps or after a random idle time."""
        await wait(self._timing.idle() if after is None else after, ODD)
        for name, level in levels.items():
            getattr(self._dut, name).value = level
        self._moved = now()
        self._levels.update(levels)
        self.controls.append(Controls(now(), *self._levels.values()))

    async def store(self, bank: int = 0) -> None:
        """From standby: store the next whole frame."""
        await self.set(BANK=bank)
        if random.random() < 0.5:
            await self.set(RNW=0)
            await self.set(ENABLE=1)
        else:
            await self.set(RNW=0, ENABLE=1)

    async def acknowledged(self, patience: int = 10**9) -> bool:
        """Poll ACK for at most ``patience`` ps."""
        limit = now() + patience
        while not int(self._dut.ACK.value):
            if now() > limit:
                return False
            await wait(random.randrange(300_000), ODD)
        return True

    async def open(self, bank: int = 0) -> None:
        """From standby: make ready to read."""
        await self.set(BANK=bank, RNW=1)
        await self.set(ENABLE=1)

    async def clock(self) -> int:
        """One data clock, after the SRAM's access time; the byte it presents."""
        await wait(max(self._timing.data_half(), self._moved + SLOWEST_ACCESS + 2 - now()), ODD)
        self._dut.DCLK.value = 1
        self.data_clocks.append(now())
        self._moved = now()
        await wait(self._timing.data_half(), ODD)
        self._dut.DCLK.value = 0
        return int(self._dut.DATA.value)

    async def read(self, count: int) -> bytes:
        return bytes([await self.clock() for _ in range(count)])

    async def standby(self) -> None:
        await self.set(ENABLE=0)


async def watch(signal: Any, seen: list[tuple[int, int]]) -> None:
    """Note the time and level whenever a signal has settled at another one."""
    while True:
        await signal.value_change
        await ReadOnly()
        if int(signal.value) != seen[-1][1]:
            seen.append((now(), int(signal.value)))


def check_stores(
    camera: Camera, mcu: Mcu, ack: Sequence[tuple[int, int]], pulses: Iterable[Pulse]
) -> None:
    """ACK and the write pulses of a board's stores, to the ps, wherever in memory they went.

    Of all its ``pulses`` those count that the camera's clock began: at even ps.
    """
    expected = behaviour(GEOMETRY, bytes(2 * GEOMETRY.bank_size), camera.clocks, mcu.controls, ())
    assert list(ack) == expected.ack
    own = [pulse for pulse in pulses if pulse.start % 2 == EVEN]
    assert _positions(own) == _positions(expected.pulses)


def _positions(pulses: Iterable[Pulse]) -> list[Pulse]:
    return [pulse._replace(address=pulse.address % GEOMETRY.bank_size) for pulse in pulses]


class Surroundings(Protocol):
    """What the bench of every top can do. A place is one that a picture is stored at."""

    PLACES: ClassVar[tuple[Any, ...]]

    @classmethod
    async def start(cls, dut: Any, timing: Timing = ANY) -> Self:
        """In standby, with the camera's clock running."""

    async def begin(self, place: Any, content: bytes) -> None:
        """From standby: storing begins, and a picture is sent."""

    async def acknowledged(self, place: Any) -> bool:
        """Wait for ACK, for as long as the picture may take."""

    async def standby(self) -> None:
        """At any moment, from any state."""

    async def fetch(self, place: Any) -> bytes:
        """From standby to standby: the processor reads the picture there."""

    async def check(self) -> object:
        """In the end: everything is as the scoreboard says. Ends in standby."""


class Bench:
    """The published board with all that surrounds it. ``start`` it, use it, ``check`` it."""

    PLACES: ClassVar[tuple[int, ...]] = (0, 1)  # banks

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        self.dut = dut
        for name in ("ENABLE", "RNW", "BANK", "DCLK", "PIXCLK", "PIXDATA", "HSYNC", "VSYNC"):
            getattr(dut, name).value = 0
        dut.SRAM_D_I.value = 0
        self.camera = Camera(dut, timing)
        self.mcu = Mcu(dut, timing)
        self.sram = Sram(dut, GEOMETRY)
        self._before = bytes(self.sram.memory)
        self._seen: dict[str, list[tuple[int, int]]] = {"ACK": [(0, 0)], "DATA": [(0, 0)]}

    @classmethod
    async def start(cls, dut: Any, timing: Timing = ANY, *, camera: bool = True) -> "Bench":
        """In standby, with the camera's clock running or still."""
        bench = cls(dut, timing)
        await Timer(1, unit="ns")
        assert outputs(dut) == STANDBY
        bench.sram.start()
        for name in bench._seen:
            cocotb.start_soon(watch(getattr(dut, name), bench._seen[name]))
        if camera:
            cocotb.start_soon(bench.camera.run())
        return bench

    def control(self, place: int) -> Mcu:
        """Who drives the pins that lead to a place."""
        return self.mcu

    async def command(self, place: int) -> None:
        """From standby to storing, without waiting for the camera."""
        await self.mcu.store(place)

    async def store(self, bank: int = 0) -> None:
        """From standby to storing, in time for a frame that is sent from now on."""
        await self.command(bank)
        await self.camera.reach(len(self.camera.clocks) + 3)  # reset's two, and HSYNC seen low

    async def begin(self, place: int, content: bytes) -> None:
        await self.store(place)
        self.camera.send(frame(content))

    async def acknowledged(self, place: int) -> bool:
        return await self.mcu.acknowledged(patience(self.camera))

    async def standby(self) -> None:
        await self.mcu.standby()

    async def fetch(self, place: int) -> bytes:
        await self.mcu.open(place)
        content = await self.mcu.read(GEOMETRY.pixels)
        await self.mcu.standby()
        return content

    def stored(self, bank: int = 0) -> bytes:
        """The SRAM's picture, row by row."""
        rows, columns = range(GEOMETRY.rows), range(GEOMETRY.columns)
        return bytes(self.sram.memory[GEOMETRY.address(x, y, bank)] for y in rows for x in columns)

    async def check(self) -> Behaviour:
        """Go to standby and compare every pin and the memory with the reference, to the ps."""
        await self.mcu.standby()
        await Timer(1, unit="ns")
        expected = behaviour(
            GEOMETRY, self._before, self.camera.clocks, self.mcu.controls, self.mcu.data_clocks
        )
        assert self.sram.pulses == expected.pulses
        assert self.sram.edges == len(expected.pulses)
        assert self._seen["ACK"] == expected.ack
        assert self._seen["DATA"] == expected.data
        assert self.sram.memory == expected.memory
        cover_cubestar.sample(
            self.camera.clocks, self.camera.period, self.mcu.controls, self.mcu.data_clocks
        )
        return expected
