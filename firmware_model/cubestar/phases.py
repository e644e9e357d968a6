"""Duration of each phase of the work, by the processor's own timer: ``*_us`` of ``Retained``.

The phases are those of table 6.2 in the CubeStar thesis, and the steps of section 5.3.
"""

from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.interface.cubestar.codes import TaskStatus
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine, Sleep


def start_loop(state: State) -> Routine[None]:
    """Record the start of the main loop; the time since the reset counts as idle time."""
    now_us: int = yield ReadTimer()
    state.task_status = TaskStatus.POWERED_UP
    state.startup_us = now_us - state.retained.reset_us
    state.retained.idling_us += state.startup_us


def begin_capture(state: State) -> None:
    """Record the start of a capture: publish the idle time since the last one."""
    state.retained.idle_us, state.retained.idling_us = state.retained.idling_us, 0


def end(state: State, name: str, started_us: int) -> Routine[int]:
    """Record the end of phase ``name``, which began at ``started_us``; returns its us."""
    now_us: int = yield ReadTimer()
    setattr(state.retained, name, now_us - started_us)
    return now_us - started_us


def idle(state: State, deadline_us: int | None) -> Routine[None]:
    """Sleep until woken, at most until ``deadline_us``."""
    started_us: int = yield ReadTimer()
    yield Sleep(deadline_us)
    now_us: int = yield ReadTimer()
    state.retained.idling_us += now_us - started_us
