"""Several boards on one I2C bus, each with the kernel that it was made with."""

from collections.abc import Sequence

from cubestack.emulator.bus.i2c import I2cBus, I2cTarget
from cubestack.emulator.sim.virtual_time import Kernel

__all__ = ["JoinedKernel", "join_buses"]


class JoinedKernel(Kernel):
    """Kernels that go through time together, for whoever drives them.

    Events are worked off in the order of their times, whichever kernel they belong to. Events of
    its own it has none.
    """

    def __init__(self, kernels: Sequence[Kernel]) -> None:
        """Join ``kernels``, at least one."""
        super().__init__()
        self._kernels = kernels

    @property
    def now(self) -> int:
        """See Kernel."""
        return max([kernel.now for kernel in self._kernels])

    def peek(self) -> float:
        """See simpy.Environment."""
        return min([kernel.peek() for kernel in self._kernels])

    def step(self) -> None:
        """Work off the next event."""
        min(self._kernels, key=Kernel.peek).step()

    def advance_to(self, time_ps: int) -> None:
        """See Kernel."""
        while (horizon := self.horizon()) is not None and horizon < time_ps:
            self.step()
        for kernel in self._kernels:
            kernel.advance_to(time_ps)


def join_buses(first: tuple[Kernel, I2cBus], *others: tuple[Kernel, I2cBus]) -> None:
    """Put what is on the ``others`` on the ``first`` bus as well; ValueError if addresses clash."""
    kernel, bus = first
    for other_kernel, other in others:
        for address, target in other.targets.items():
            bus.attach(address, _Visitor(kernel, other_kernel, target))


class _Visitor:
    """A target of another kernel, which is brought to this bus's time before it is called."""

    def __init__(self, here: Kernel, there: Kernel, target: I2cTarget) -> None:
        self._here = here
        self._there = there
        self._target = target

    def _meet(self) -> I2cTarget:
        self._there.advance_to(self._here.now)
        return self._target

    def i2c_start(self, read: bool) -> None:
        self._meet().i2c_start(read)

    def i2c_write(self, byte: int) -> bool:
        return self._meet().i2c_write(byte)

    def i2c_read(self) -> int | None:
        return self._meet().i2c_read()

    def i2c_stop(self) -> None:
        self._meet().i2c_stop()
