"""Virtual time as an integer number of picoseconds, its kernel, and exact clock conversion."""

from functools import partial
from itertools import count
from time import monotonic_ns
from typing import TYPE_CHECKING

import simpy

PS_PER_S = 10**12
PS_PER_MS = 10**9
PS_PER_US = 10**6


class Kernel(simpy.Environment):
    """SimPy's environment with an integer clock in ps.

    Attributes:
        now: the time in ps; only events and ``advance_to`` change it.
        idle_until: before this time in ps the host that drives the kernel does nothing, whatever is
            in the queue now; 0 where that is unknown.
        held_ns: wall time of all finished pauses.
    """

    # Slots are read faster than other attributes; the first three are SimPy's.
    __slots__ = ("_eid", "_now", "_queue", "idle_until")

    held_ns: int = 0

    def __init__(self, initial_time: int = 0) -> None:
        super().__init__(initial_time)
        self.idle_until: int = 0
        # SimPy binds what creates events only for objects of its own class.
        vars(self).update(event=partial(simpy.Event, self), timeout=partial(simpy.Timeout, self))
        self._holders = set[str]()
        self._since_ns = 0

    @property
    def paused(self) -> bool:
        return bool(self._holders)

    @property
    def holders(self) -> frozenset[str]:
        return frozenset(self._holders)

    def hold(self, holder: str) -> None:
        if not self._holders:
            self._since_ns = monotonic_ns()
        self._holders.add(holder)

    def release(self, holder: str) -> None:
        """End a hold of ``holder``; other holders keep the kernel paused."""
        if self._holders == {holder}:
            self.held_ns += monotonic_ns() - self._since_ns
        self._holders.discard(holder)

    if TYPE_CHECKING:  # all delays are whole numbers

        @property
        def now(self) -> int: ...

    def restart(self) -> None:
        """Clear all events and set the time to 0; holds remain."""
        self._queue.clear()
        self._eid = count()
        self._now = 0

    def horizon(self) -> int | None:
        """Time of the next scheduled event in ps; None if there is none."""
        queue = self._queue
        return queue[0][0] if queue else None  # type: ignore[return-value]  # whole numbers

    @property
    def watched(self) -> bool:
        """Whether a trace or a debugger observes each step."""
        return "step" in self.__dict__

    def advance_to(self, time_ps: int) -> None:
        """Run all events before ``time_ps``, then stop at that time; a past time does nothing.

        Unlike ``run``, it leaves no event behind that ``horizon`` would report.
        """
        if time_ps <= self._now:
            return
        queue = self._queue
        if (not queue or queue[0][0] >= time_ps) and not self.watched:
            self._now = time_ps  # no event until then, and no observer of steps
            return
        arrival = self.urgent(time_ps)  # limits the look-ahead of others
        while not arrival.processed:
            self.step()

    def urgent(self, time_ps: int) -> simpy.Event:
        """Schedule and return an event that comes before all others at ``time_ps``."""
        event = simpy.Event(self)
        event._ok, event._value = True, None
        self.schedule(event, simpy.events.URGENT, time_ps - self.now)
        return event


Kernel.now = Kernel._now  # type: ignore[misc, method-assign, assignment]


class CycleClock:
    """Converts cycle counts to picoseconds; each remainder carries over to the next call."""

    def __init__(self, hz: int) -> None:
        if hz <= 0:
            raise ValueError(f"a clock needs a positive frequency, not {hz} Hz")
        self.hz = hz
        self._remainder = 0

    def elapse(self, cycles: int) -> int:
        """Picoseconds for the next ``cycles``; their sum over all calls is exact to 1 ps."""
        ps, self._remainder = divmod(cycles * PS_PER_S + self._remainder, self.hz)
        return ps
