"""A camera on a clock of its own, and what it sends."""

import random
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from operator import itemgetter
from typing import Any, TypeVar

from cocotb.triggers import Event, FallingEdge, RisingEdge

from cubestack.hdl.contract.bench.geometry import GEOMETRY, Clock, Tick
from cubestack.hdl.contract.bench.timing import ANY, EVEN, Timing, between, now, wait

T = TypeVar("T")

HOLD = SETUP = 2_000  # ps around the rising PIXCLK in which the camera's pins stand still
NEVER = 1 << 62


def picture() -> bytes:
    return random.randbytes(GEOMETRY.pixels)


def line(pixels: Iterable[int], blanking: int | None = None) -> Iterator[Tick]:
    """A line's pixels, then HSYNC low for ``blanking`` clocks, or a random number of them."""
    for pixel in pixels:
        yield Tick(pixel, 1, 1)
    for _ in range(blanking or random.randint(1, 6)):
        yield Tick(random.randrange(256), 0, 1)


def vsync(clocks: int | None = None) -> Iterator[Tick]:
    for _ in range(clocks or random.randint(1, 9)):
        yield Tick(random.randrange(256), 0, 0)


def lines(content: bytes, blanking: int | None = None) -> list[list[Tick]]:
    size = GEOMETRY.columns
    starts = range(0, len(content), size)
    return [list(line(content[start : start + size], blanking)) for start in starts]


def flat(parts: Iterable[Iterable[T]]) -> list[T]:
    return list(chain.from_iterable(parts))


def frame(content: bytes) -> list[Tick]:
    return [*vsync(), *flat(lines(content))]


class Camera:
    """Free-running source: its rate, phase, duty cycle and stretched clocks are ``timing``'s.

    Its pins change at random between hold and set-up time. With nothing to send it is between two
    lines. ``clocks`` is the record of what it did.
    """

    def __init__(self, dut: Any, timing: Timing = ANY) -> None:
        self._dut = dut
        self._queue: deque[Tick] = deque()
        self._shown = False  # the pins show a tick that was sent and not clocked yet
        self._pins = Tick(0, 0, 1)
        self._running = Event()
        self._running.set()
        self.period = between(timing.pixel_periods) // 2 * 2
        self.stalls = random.choice(timing.stall_rates)
        self._phase = int(random.uniform(*timing.phases) * self.period)
        self._duty = random.uniform(*timing.duties)
        self.clocks: list[Clock] = []

    @property
    def busy(self) -> bool:
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
        while self.busy:
            await RisingEdge(self._dut.PIXCLK)

    async def started(self) -> None:
        """Wait until a writer that was just started takes lines: reset's two clocks, one more."""
        await self.reach(len(self.clocks) + 3)

    async def reach(self, clocks: int) -> None:
        while len(self.clocks) < clocks:
            await RisingEdge(self._dut.PIXCLK)

    async def hold(
        self, there: Sequence[Tick], stay: Sequence[Tick], *, exactly: bool, low: bool
    ) -> None:
        """Send what leads ``there`` and lets it ``stay``, and wait for a clock of the latter.

        That is ``exactly`` the first one, or one of the first half; ``low``: until it has fallen.
        """
        first = await self.begin([*there, *stay]) + len(there) + 1
        await self.reach(first if exactly else first + random.randrange(len(stay) // 2))
        if low:
            await FallingEdge(self._dut.PIXCLK)

    def stop(self) -> None:
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
            steps = [(high, self._fall), (change, self._show)]
            for moment, act in sorted(steps, key=itemgetter(0)):
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
