"""Virtual time: an integer number of picoseconds, its kernel, and clocks that convert exactly."""

from itertools import count
from time import monotonic_ns

import simpy

PS_PER_S = 10**12
PS_PER_MS = 10**9
PS_PER_US = 10**6


class Kernel(simpy.Environment):
    """SimPy's environment with an integer clock in ps.

    Attributes:
        held_ns: wall time of all pauses that are over.
    """

    held_ns: int = 0

    def __init__(self, initial_time: int = 0) -> None:
        """Begin at ``initial_time``."""
        super().__init__(initial_time)
        self._holders = set[str]()
        self._since_ns = 0

    @property
    def paused(self) -> bool:
        """Whether anybody holds it, as a debugger that has halted a processor."""
        return bool(self._holders)

    @property
    def holders(self) -> frozenset[str]:
        """Who holds it."""
        return frozenset(self._holders)

    def hold(self, holder: str) -> None:
        """Let nothing happen until ``holder`` releases it."""
        if not self._holders:
            self._since_ns = monotonic_ns()
        self._holders.add(holder)

    def release(self, holder: str) -> None:
        """``holder`` holds it no more; it may be held by others."""
        if self._holders == {holder}:
            self.held_ns += monotonic_ns() - self._since_ns
        self._holders.discard(holder)

    @property
    def now(self) -> int:
        """Virtual time in ps."""
        return self._now  # type: ignore[return-value]  # all delays are whole numbers

    def restart(self) -> None:
        """Begin at 0 again with nothing to come; who holds it still does."""
        self._queue.clear()
        self._eid = count()
        self._now = 0

    def horizon(self) -> int | None:
        """Time of the next scheduled event in ps; None when there is none."""
        peek = self.peek()
        return None if peek == float("inf") else int(peek)

    def advance_to(self, time_ps: int) -> None:
        """Let everything before ``time_ps`` happen, then stand there; a past time does nothing.

        Unlike ``run``, it leaves no event of its own behind, which would pass for the horizon.
        """
        if time_ps <= self._now:
            return
        if self.peek() >= time_ps and "step" not in vars(self):
            self._now = time_ps  # nothing happens before, and nobody stands before each step
            return
        arrival = _Arrival(self, time_ps)  # what looks ahead meanwhile stops there
        while not arrival.processed:
            self.step()


class _Arrival(simpy.Event):
    """Comes before all else that happens at its time."""

    def __init__(self, env: Kernel, time_ps: int) -> None:
        super().__init__(env)
        self._ok = True
        self._value = None
        env.schedule(self, simpy.events.URGENT, time_ps - env.now)


class CycleClock:
    """Turns cycle counts into picoseconds; what one conversion rounds off, the next one pays.

    Attributes:
        hz: clock frequency.
    """

    def __init__(self, hz: int) -> None:
        """Make a clock of ``hz`` cycles a second (positive, else ValueError)."""
        if hz <= 0:
            raise ValueError(f"a clock needs a positive frequency, not {hz} Hz")
        self.hz = hz
        self._remainder = 0

    def elapse(self, cycles: int) -> int:
        """Picoseconds that the next ``cycles`` take; summed over calls, exact to one ps."""
        ps, self._remainder = divmod(cycles * PS_PER_S + self._remainder, self.hz)
        return ps
