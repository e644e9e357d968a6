"""Which points of coverage CubeStar's tops reached, from what their pins did."""

import os
from collections.abc import Sequence
from itertools import pairwise

from cubestack.hdl.contract.bench.geometry import Clock
from cubestack.hdl.contract.cubestar.board import Controls
from tests.hdl.coverage.points import CUBESTAR, hit
from tests.hdl.harness.reference import Window, windows
from tests.hdl.harness.store_states import left_in, read_state, steps

#: The design that is simulated, or None for one that is no top of ours.
TOP = CUBESTAR.get(os.environ.get("DESIGN", ""))

STOPPED = 25  #: Periods without an edge after which a clock has stopped; stalls are shorter


def sample(
    clocks: Sequence[Clock],
    period: int,
    controls: Sequence[Controls],
    data_clocks: Sequence[int] | None = None,
) -> None:
    """All of one board's stores, and its read-outs if it has a data clock."""
    if TOP is None:
        return
    for window in windows(controls):
        before = next(c for c in reversed(controls) if c.time < window.end)
        after = next(c for c in controls if c.time >= window.end)
        left_by = _left_by(before, after)
        if not window.rnw:
            _store(window, clocks, period, left_by)
        elif data_clocks is not None:
            count = sum(window.start < time < window.end for time in data_clocks)
            hit("cubestar read", left_in=read_state(count), left_by=left_by)
    if TOP == "published":
        _commands(clocks, period, controls)


def _left_by(before: Controls, after: Controls) -> str:
    if before.enable == after.enable:
        return "RNW"
    return "ENABLE" if before.rnw == after.rnw else "both"


def _store(window: Window, clocks: Sequence[Clock], period: int, left_by: str) -> None:
    own = [clock for clock in clocks if window.start < clock.rise < window.end]
    stepped = list(steps([clock.pins for clock in own]))
    state = left_in(own, stepped, window.end)
    if TOP == "published" or left_by == "ENABLE" or (left_by, TOP) == ("RNW", "double"):
        hit("cubestar store", top=TOP, left_in=state, left_by=left_by)
    if TOP != "published" or not own:
        return
    acknowledged = "yes" if any(step.state == "ACK" for step in stepped) else "no"
    for case in stepped[-1].borders:
        hit("cubestar border", case=case, acknowledged=acknowledged)
    for clock, end in zip(own, [clock.rise for clock in own[1:]] + [window.end], strict=True):
        if end - clock.rise > STOPPED * period:
            level = "high" if min(clock.fall, end) - clock.rise > STOPPED * period else "low"
            hit("cubestar border", case=f"clock stops {level}", acknowledged=acknowledged)


def _commands(clocks: Sequence[Clock], period: int, controls: Sequence[Controls]) -> None:
    for before, now in pairwise(controls):
        if now.enable and not before.enable:
            camera = _camera(clocks, period, now.time)
            command = "read" if now.rnw else "store"
            rnw = "before" if now.rnw == before.rnw else "with ENABLE"
            if rnw == "before" or (command, camera) == ("store", "runs"):
                hit("cubestar command", command=command, bank=now.bank, camera=camera, rnw=rnw)


def _camera(clocks: Sequence[Clock], period: int, time: int) -> str:
    before = [clock for clock in clocks if clock.rise < time]
    after = [clock for clock in clocks if clock.rise >= time]
    last = before[-1].rise if before else time
    if (after or before) and (after[0].rise if after else time) - last <= STOPPED * period:
        return "runs"
    if not before:
        return "never ran"
    return "stopped low" if before[-1].fall < time else "stopped high"
