"""How long each phase of the work took, by the processor's own timer."""

from cubestack.firmware_model.cubestar.state import Retained
from cubestack.firmware_model.hardware import ReadTimer, Routine, Sleep

__all__ = ["Phases"]


class Phases:
    """Measures phases into the ``*_us`` fields of ``Retained``."""

    def __init__(self, retained: Retained) -> None:
        """Measure into ``retained``."""
        self._retained = retained
        self._idle_us = 0

    def begin_capture(self) -> None:
        """A capture begins: publish how long the node idled since the last one."""
        self._retained.idle_us = self._idle_us
        self._idle_us = 0

    def end(self, name: str, started_us: int) -> Routine[int]:
        """Phase ``name`` that started at ``started_us`` is over; returns its duration in us."""
        now_us: int = yield ReadTimer()
        setattr(self._retained, name, now_us - started_us)
        return now_us - started_us

    def idle(self, deadline_us: int | None) -> Routine[bool]:
        """Sleep until woken, at most until ``deadline_us``; returns whether it was woken."""
        started_us: int = yield ReadTimer()
        woken: bool = yield Sleep(deadline_us)
        now_us: int = yield ReadTimer()
        self._idle_us += now_us - started_us
        return woken
