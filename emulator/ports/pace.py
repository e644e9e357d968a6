"""How virtual time follows wall time: one scale for all who pace by it."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from cubestack.emulator.sim.virtual_time import Kernel

Mode = Literal["real", "fast"]

PS_PER_NS = 1000


@dataclass
class Pace:
    """Attributes:
    kernel: virtual time; while it is paused, no wall time passes on the scale.
    mode: "real": virtual time follows wall time; "fast": it runs ahead while there is work.
    clock_ns: wall time in ns from any origin; never runs back.
    speed: virtual seconds in a second of wall time, where virtual time follows that.
    """

    kernel: Kernel
    mode: Mode
    clock_ns: Callable[[], int] = time.monotonic_ns
    speed: float = field(default=1.0, init=False)

    def __post_init__(self) -> None:
        """Begin where virtual time is."""
        self._offset_ps = 0
        self.align()

    @property
    def fast(self) -> bool:
        """Whether virtual time need not follow wall time."""
        return self.mode == "fast"

    def change(self, mode: Mode, speed: float = 1.0) -> None:
        """Go on otherwise from here."""
        self.mode, self.speed = mode, speed
        self.align()

    def align(self) -> None:
        """Go on from here: what virtual time is ahead of wall time, or behind, does not count."""
        self._offset_ps = 0
        self._offset_ps = self.kernel.now - self.now_ps()

    def now_ns(self) -> int:
        """Wall time, pauses left out; it never jumps."""
        return self.clock_ns() - self.kernel.held_ns

    def now_ps(self) -> int:
        """Wall time on the scale of virtual time."""
        return self.ps_at(self.now_ns())

    def ps_at(self, ns: int) -> int:
        """A time of ``now_ns`` on the scale of virtual time."""
        wall_ps = ns * PS_PER_NS
        return (wall_ps if self.speed == 1.0 else round(wall_ps * self.speed)) + self._offset_ps

    def ns_at(self, ps: int) -> int:
        """When the scale gets to ``ps``, as ``now_ns`` has it; rounded up."""
        wall_ps = ps - self._offset_ps
        return -(-(wall_ps if self.speed == 1.0 else round(wall_ps / self.speed)) // PS_PER_NS)
