"""How long each phase of the work took, by the processor's own timer.

The phases are those of table 6.2 in the CubeStar thesis, and the steps of section 5.3.
"""

from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine, Sleep


class Phases:
    """Measures phases into the ``*_us`` fields of ``Retained``."""

    def __init__(self, state: State) -> None:
        """Measure into ``state.retained``."""
        self._state = state

    def started(self) -> Routine[None]:
        """The main loop starts: how long that took since the reset counts as idle time."""
        now_us: int = yield ReadTimer()
        self._state.startup_us = now_us - self._state.retained.reset_us
        self._state.retained.idling_us += self._state.startup_us

    def begin_capture(self) -> None:
        """A capture begins: publish how long the node idled since the last one."""
        self._state.retained.idle_us = self._state.retained.idling_us
        self._state.retained.idling_us = 0

    def end(self, name: str, started_us: int) -> Routine[int]:
        """Phase ``name`` that started at ``started_us`` is over; returns its duration in us."""
        now_us: int = yield ReadTimer()
        setattr(self._state.retained, name, now_us - started_us)
        return now_us - started_us

    def idle(self, deadline_us: int | None) -> Routine[None]:
        """Sleep until woken, at most until ``deadline_us``."""
        started_us: int = yield ReadTimer()
        yield Sleep(deadline_us)
        now_us: int = yield ReadTimer()
        self._state.retained.idling_us += now_us - started_us
