"""A microcontroller that drives a board's control pins, and reads byte by byte."""

import random
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Generic, TypeVar

from cubestack.hdl.contract.bench.timing import ANY, ODD, SLOWEST_ACCESS, Timing, between, now, wait

C = TypeVar("C")


class Processor(Generic[C]):
    """Drives the control pins at random moments of its own; ``CLOCK`` is the data clock's pin.

    ``controls`` are the pins' levels, each with the time (ps) from which on it has them,
    ``data_clocks`` the times of the data clock's rising edges.
    """

    CLOCK: ClassVar[str]

    def __init__(
        self, dut: Any, record: Callable[..., C], levels: Mapping[str, int], timing: Timing = ANY
    ) -> None:
        """Control the pins that ``levels`` names, which have these levels now."""
        self._dut = dut
        self._timing = timing
        self._record = record
        self._levels = dict(levels)
        self._moved = 0  # when the SRAM's address may have changed last
        self.controls: list[C] = [record(now(), *self._levels.values())]
        self.data_clocks: list[int] = []

    async def set(self, after: int | None = None, **levels: int) -> None:
        """Drive pins together, ``after`` ps or after a random idle time."""
        await wait(between(self._timing.idles) if after is None else after, ODD)
        for name, level in levels.items():
            getattr(self._dut, name).value = level
        self._moved = now()
        self._levels.update(levels)
        self.controls.append(self._record(now(), *self._levels.values()))

    async def sees(self, ack: str, patience: int = 10**9) -> bool:
        """Poll a pin for at most ``patience`` ps."""
        limit = now() + patience
        while not int(getattr(self._dut, ack).value):
            if now() > limit:
                return False
            await wait(random.randrange(300_000), ODD)
        return True

    async def clock(self) -> int:
        """One data clock, after the SRAM's access time; the byte it presents."""
        await wait(
            max(between(self._timing.data_halves), self._moved + SLOWEST_ACCESS + 2 - now()), ODD
        )
        pin = getattr(self._dut, self.CLOCK)
        pin.value = 1
        self._moved = now()
        self.data_clocks.append(now())
        await wait(between(self._timing.data_halves), ODD)
        pin.value = 0
        return int(self._dut.DATA.value)

    async def read(self, count: int) -> bytes:
        return bytes([await self.clock() for _ in range(count)])
