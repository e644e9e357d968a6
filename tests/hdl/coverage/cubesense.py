"""Which points of coverage CubeSense's pair reached, from what its pins did."""

import os
from collections.abc import Mapping, Sequence
from itertools import pairwise

from cubestack.firmware_model.interface.cubesense.fpga import Action
from cubestack.hdl.contract.bench.geometry import Clock
from tests.hdl.coverage.points import PAIRS, SEND_STATES, TAKE_STATES, hit, row_of
from tests.hdl.cubesense import reference
from tests.hdl.cubesense.reference import MCU_ADDRESSING, READ_OUT, SIDES, Controls, Half, Window
from tests.hdl.harness.store_states import left_in, read_state, steps

#: The design that is simulated, or None for one that is no pair of ours.
TOP = PAIRS.get(os.environ.get("DESIGN", ""))


def sample(
    halves: Mapping[str, Half],
    cameras: Mapping[str, Sequence[Clock]],
    controls: Sequence[Controls],
    data_clocks: Sequence[int],
) -> None:
    if TOP is None:
        return
    _rows(controls)
    for side, half in halves.items():
        other = SIDES[1 - SIDES.index(side)]
        sending = [w for w in halves[other].windows if w.action is Action.SEND_PICTURE]
        link = reference.link_clocks(sending, cameras[other])
        for place in half.suns_read:
            _sun(side, place)
        clocks = {Action.STORE: cameras[side], Action.STORE_OTHER: link}
        for window in half.windows:
            count = sum(window.start < time < window.end for time in data_clocks)
            camera = side if window.action is Action.STORE else other
            if window.action in clocks:
                _store(window, clocks[window.action], camera, side)
            elif window.action is Action.SEND_PICTURE:
                _state(side, window.action, _sending(window, cameras[side]))
            else:
                _state(side, window.action, _reading(side, window.action, count))


def _sun(side: str, place: tuple[int, int]) -> None:
    """A window that is read in a memory, around a first Sun pixel or around none."""
    if place == reference.NOT_FOUND:
        hit("sun window", memory=side, column="none", row="none")
        return
    (x, y), size = place, READ_OUT.window
    left, top = x - READ_OUT.window_left, y - READ_OUT.window_above  # of the window that is wanted
    column = ("left", "inside", "right")[(left >= 0) + (left > READ_OUT.columns - size)]
    row = ("top", "inside", "bottom")[(top >= 0) + (top > READ_OUT.rows - size)]
    hit("sun window", memory=side, column=column, row=row)


def _rows(controls: Sequence[Controls]) -> None:
    """Rows that lasted, each with the order in which the enables left standby."""
    enabled = "together"
    for before, now in pairwise(controls):
        was = before.sunen + before.naden
        if now.sunen + now.naden or was == 2:
            enabled = "together"
        elif was:
            enabled = "one by one"
        row = row_of(*now[1:], mcu_addressing=MCU_ADDRESSING)
        if row != "xxx11":
            hit("pair command", top=TOP, row=row, enables=enabled)


def _state(side: str, action: Action, state: str) -> None:
    if (TOP == "addressing") == (action in reference.ADDRESSING):
        hit("pair state", top=TOP, side=side, action=action, state=state)


def _store(window: Window, clocks: Sequence[Clock], camera: str, memory: str) -> None:
    own = [clock for clock in clocks if window.start < clock.rise < window.end]
    levels = reference.vsync([clock.pins.hsync for clock in own[2:]])
    ticks = [clock.pins for clock in own]
    ticks[2:] = [tick._replace(vsync=level) for tick, level in zip(ticks[2:], levels, strict=True)]
    stepped = list(steps(ticks, gaps=True))
    state = left_in(own, stepped, window.end)
    if state != "before a line":
        _state(memory, window.action, state)
    if stepped:
        acknowledged = "yes" if any(step.state == "ACK" for step in stepped) else "no"
        for case in stepped[-1].borders:
            parts = {"camera": camera, "memory": memory, "acknowledged": acknowledged}
            hit("pair border", case=case, **parts)


def _sending(window: Window, camera: Sequence[Clock]) -> str:
    before = [clock for clock in camera if clock.rise < window.end]
    if not before:
        return SEND_STATES[3]
    last = before[-1]
    return SEND_STATES[2 * (not last.pins.hsync) + (last.fall < window.end)]


def _reading(side: str, action: Action, count: int) -> str:
    if action is Action.PASS_EDGE:
        return "passing"
    if action is Action.TAKE_ADDRESS:
        return TAKE_STATES[min(count, len(TAKE_STATES) - 1)]
    if action is Action.READ_FROM:
        return "no clock" if not count else "addressed byte" if count == 1 else "next bytes"
    if action is Action.READ:
        return read_state(count)
    if (side == "sun") == (action is Action.EDGE):
        if count < 4:
            return "ABCD"[count]
        return "E" if count < 4 + READ_OUT.window**2 else "E again"
    rows = 1 + len(READ_OUT.scan_rows) * READ_OUT.columns
    if count >= READ_OUT.scan_clocks:
        return "C again"
    return "default" if not count else "A" if count < rows else "B" if count == rows else "C"
