"""The relation of virtual time and wall time, shared by all that pace the emulation."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from cubestack.emulator.sim.virtual_time import Kernel

Mode = Literal["real", "fast"]

PS_PER_NS = 1000


@dataclass
class Pace:
    """A scale that converts wall time to virtual time."""

    kernel: Kernel  # virtual time; pauses of it do not count as wall time
    mode: Mode  # "real": virtual time follows wall time; "fast": it runs ahead while there is work
    clock_ns: Callable[[], int] = time.monotonic_ns  # monotonic wall time in ns, from any origin
    # virtual seconds per second of wall time, where virtual time follows wall time
    speed: float = field(default=1.0, init=False)

    def __post_init__(self) -> None:
        self._offset_ps = 0
        self.align()

    @property
    def fast(self) -> bool:
        return self.mode == "fast"

    def change(self, mode: Mode, speed: float = 1.0) -> None:
        self.mode, self.speed = mode, speed
        self.align()

    def align(self) -> None:
        """Set the scale to the present virtual time, so that earlier lead or lag does not count."""
        self._offset_ps = 0
        self._offset_ps = self.kernel.now - self.now_ps()

    def now_ns(self) -> int:
        """Wall time in ns without pauses; it never jumps."""
        return self.clock_ns() - self.kernel.held_ns

    def now_ps(self) -> int:
        return self.ps_at(self.now_ns())

    def ps_at(self, ns: int) -> int:
        """Convert a time of ``now_ns`` to virtual time."""
        wall_ps = ns * PS_PER_NS
        return (wall_ps if self.speed == 1.0 else round(wall_ps * self.speed)) + self._offset_ps

    def ns_at(self, ps: int) -> int:
        """The time of ``now_ns`` for virtual time ``ps``, rounded up."""
        wall_ps = ps - self._offset_ps
        return -(-(wall_ps if self.speed == 1.0 else round(wall_ps / self.speed)) // PS_PER_NS)
