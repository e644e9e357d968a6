"""A loop without upsets: its phases, and the state when the FPGAs are done."""

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.studies.upsets.subject import (
    BETWEEN,
    IDLE,
    STORING,
    PortWatch,
    Subject,
    UpsetVerdict,
)

PS_PER_S = 10**12

LONGEST_S = 30.0
"""Time-out of a loop in virtual time."""


class NoLoopError(RuntimeError):
    """The loop does not end."""


@dataclass(frozen=True)
class Interval:
    """One phase in ps of virtual time, and the camera whose image is stored in it."""

    phase: str
    start_ps: int
    end_ps: int
    camera: str | None = None


@dataclass(frozen=True)
class Snapshot:
    """State when the FPGAs are done."""

    #: data, seen: bytes that the processor read, and times of acknowledges
    data: NDArray[np.uint8]
    seen: list[tuple[int, str, int]]
    registers: bytes  #: of the FPGAs
    memories: dict[str, NDArray[np.uint8]]  #: of all of the board, by name
    violations: dict[str, int]  #: broken rules of the memories' timing, by kind


@dataclass(frozen=True)
class CleanLoop:
    """A loop without upsets."""

    intervals: list[Interval]  #: of the phases, in their order
    over_ps: int  #: time when the FPGAs are done: idle, or the end
    snapshot: Snapshot  #: state at that time
    verdict: UpsetVerdict  #: of the answer

    @property
    def start_ps(self) -> int:
        return self.intervals[0].start_ps

    @property
    def end_ps(self) -> int:
        return self.intervals[-1].end_ps

    def seconds(self, period_s: float) -> dict[str, float]:
        """Duration of each phase from the end of one loop to the next."""
        rest_s = period_s - (self.end_ps - self.start_ps) / PS_PER_S
        found = {self.intervals[-1].phase: max(0.0, rest_s)}
        for one in self.intervals:
            found[one.phase] = found.get(one.phase, 0.0) + (one.end_ps - one.start_ps) / PS_PER_S
        return found


class _State(NamedTuple):
    """The FPGAs' state from a time on, and the camera whose image they store."""

    start_ps: int
    state: str
    camera: str | None


def _state(now_ps: int, subject: Subject, engine: RtlEngine) -> _State:
    cameras = (name for name in engine.wiring.storing(engine.get_pin) if name)
    return _State(now_ps, subject.state(engine), next(iter(cameras), None))


def clean_loop(
    emulated: AnyEmulated, subject: Subject, sites: Sites, watch: PortWatch
) -> CleanLoop:
    """Run the started loop to its end; for use in a copy.

    Raises NoLoopError.
    """
    kernel, engine = emulated.board.kernel, sites.engine
    assert engine is not None
    until_ps = kernel.now + round(LONGEST_S * PS_PER_S)
    states = [_state(kernel.now, subject, engine)]
    snapshot = None
    while emulated.board.busy() or len(states) == 1:
        if kernel.now >= until_ps:
            raise NoLoopError(f"no loop of {emulated.device.name} ends within {LONGEST_S:g} s")
        kernel.step()
        state = _state(kernel.now, subject, engine)
        if state.state != states[-1].state:
            states.append(state)
            if state.state == IDLE:
                snapshot = deepcopy(take(sites, watch))
    over_ps = states[-1].start_ps
    if snapshot is None or states[-1].state != IDLE:  # they connect the processor to its memory
        snapshot, over_ps = deepcopy(take(sites, watch)), kernel.now
    states.append(_State(kernel.now, IDLE, None))
    intervals = [
        one for state, then in pairwise(states) for one in _phases(state, then.start_ps, sites)
    ]
    return CleanLoop(intervals, over_ps, snapshot, subject.judge(emulated))


def take(sites: Sites, watch: PortWatch) -> Snapshot:
    """The present state as live views."""
    engine = sites.engine
    assert engine is not None
    engine.run(max(sites.kernel.now, engine.now_ps))
    return Snapshot(
        np.frombuffer(watch.data, np.uint8),
        list(watch.seen),
        engine.state(),
        sites.all_memories(),
        {str(kind): count for kind, count in engine.violation_counts.items()},
    )


def render(clean: CleanLoop, sites: Sites) -> None:
    for one in clean.intervals:
        if one.camera is None:
            continue
        source, now_ps = sites.cameras[one.camera].source, one.start_ps
        while now_ps < one.end_ps and (segment := source.segment_at(now_ps)) is not None:
            if segment.pixels is not None:
                segment.pixels()
            now_ps = int(segment.start_ps + segment.clocks * source.period) + 1


def _phases(state: _State, end_ps: int, sites: Sites) -> Iterator[Interval]:
    """The intervals of one state; pauses between a camera's images are separate."""
    if state.state != STORING or state.camera is None:
        yield Interval(state.state, state.start_ps, end_ps, state.camera)
        return
    source = sites.cameras[state.camera].source
    now_ps = state.start_ps
    while now_ps < end_ps:
        segment = source.segment_at(now_ps)
        over_ps = end_ps
        if segment is not None:
            over_ps = int(segment.start_ps + segment.clocks * source.period)
        over_ps = min(max(over_ps, now_ps + 1), end_ps)
        lines = segment is not None and segment.rows
        yield Interval(STORING if lines else BETWEEN, now_ps, over_ps, state.camera)
        now_ps = over_ps
