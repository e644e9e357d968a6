"""The common part of every top's testbench."""

from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable
from functools import wraps
from typing import Any, ClassVar, Generic, Self, TypeVar

import cocotb

from cubestack.hdl.contract.bench.camera import Camera, patience, picture
from cubestack.hdl.contract.bench.geometry import Tick
from cubestack.hdl.contract.bench.sram import Sram
from cubestack.hdl.contract.bench.timing import ANY, Timing

P = TypeVar("P")
B = TypeVar("B", bound="Testbench[Any]")

#: Decorator of tests: as `cocotb.test`, and long before this much time they are over.
timed_test = cocotb.test(timeout_time=30, timeout_unit="ms")


class Testbench(ABC, Generic[P]):
    """A top with all that surrounds it. ``start`` it, use it, ``check`` it.

    A place (of type ``P``) is one that a picture is stored at. ``shoot`` a picture to one,
    ``fetch`` it; or ``begin`` one and leave it at any moment with ``standby``.
    """

    PLACES: ClassVar[tuple[Any, ...]]

    @classmethod
    @abstractmethod
    async def start(cls, dut: Any, timing: Timing = ANY) -> Self: ...

    @abstractmethod
    def camera_of(self, place: P) -> Camera: ...

    @abstractmethod
    def memory_of(self, place: P) -> tuple[Sram, int]: ...

    @abstractmethod
    def frame(self, content: bytes) -> list[Tick]: ...

    @abstractmethod
    async def command(self, place: P) -> None: ...

    @abstractmethod
    async def acknowledged(self, place: P, patience: int | None = None) -> bool:
        """Wait for ACK, for as long as the picture may take, or for ``patience`` ps."""

    @abstractmethod
    async def standby(self) -> None: ...

    @abstractmethod
    async def fetch(self, place: P) -> bytes:
        """From standby to standby: the processor reads the picture there."""

    @abstractmethod
    async def check(self) -> object:
        """In the end: everything is as the scoreboard says. Ends in standby."""

    async def store(self, place: P) -> None:
        """From standby to storing, in time for a frame that is sent from now on."""
        await self.command(place)
        await self.camera_of(place).started()

    async def begin(self, place: P, content: bytes) -> None:
        await self.store(place)
        self.camera_of(place).send(self.frame(content))

    async def shoot(self, place: P, content: bytes | None = None) -> bytes:
        """From standby to standby: a picture is stored, a random one unless it is given."""
        content = picture() if content is None else content
        await self.begin(place, content)
        assert await self.acknowledged(place), "no ACK"
        await self.standby()
        assert self.stored(place) == content
        return content

    def stored(self, place: P) -> bytes:
        sram, bank = self.memory_of(place)
        return sram.picture(bank)

    def patience(self, place: P) -> int:
        """Time in ps in which a picture is over, however often the camera's clock stalls."""
        return patience(self.camera_of(place))


def checked_test(testbench: type[B]) -> Callable[[Callable[[B], Awaitable[None]]], Any]:
    """Decorator of timed tests of a testbench, which is started before and checked in the end."""

    def register(test: Callable[[B], Awaitable[None]]) -> Any:
        @wraps(test)
        async def started(dut: Any) -> None:
            bench = await testbench.start(dut)
            await test(bench)
            await bench.check()

        return timed_test(started)

    return register
