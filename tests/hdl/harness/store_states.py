"""What a writer is at after each clock of a camera, and the border cases that it met, for coverage.

Clock by clock, so another way than that of reference.py, but no judge: a wrong state counts for
another point and no more.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from cubestack.hdl.contract.bench.geometry import GEOMETRY, Clock, Tick


class Step(NamedTuple):
    """After one clock: what it is at, whether it writes then, and all border cases so far."""

    state: str
    writes: bool
    borders: frozenset[str]


def steps(ticks: Sequence[Tick], gaps: bool = False) -> Iterator[Step]:
    """One for each clock; the first two are the reset's, and take nothing.

    With ``gaps`` VSYNC is what gaps make of it: low until the first one ends.
    """
    borders: set[str] = set()
    row = column = 0
    seen_low = line_open = short = full = acknowledged = vsync_seen = False
    for index, (_, hsync, vsync) in enumerate(ticks):
        state, writes = "before a line", False
        if index < 2:
            state = "reset"
        elif full:
            if acknowledged:
                borders |= {"VSYNC after ACK"} if not vsync else set()
                borders |= {"lines after ACK"} if hsync and vsync and seen_low else set()
                seen_low = seen_low or not hsync
            borders |= set() if vsync_seen else {"no VSYNC before a frame"}
            state, acknowledged = "ACK", True
        elif not vsync:
            if gaps and hsync:
                borders.add("joined in a line" if index == 2 else "joined in a frame")
            elif hsync and line_open:
                borders.add("VSYNC in a line")
            if row + line_open and not vsync_seen:
                borders.add("joined in a frame")
            elif row + line_open and not short:
                borders.add("frame too short")
            row = column = 0
            line_open = short = False
            seen_low, vsync_seen = not hsync, True
            state = "between frames"
        elif not hsync:
            if line_open and column < GEOMETRY.columns:
                borders.add("line too short")
                if row == GEOMETRY.rows - 1:
                    borders.add("last row too short")
                    short = True
            if line_open:
                row, column, line_open = min(row + 1, GEOMETRY.rows - 1), 0, False
            seen_low = True
            state = "short last row" if short else "between lines" if row else "before a line"
        elif not seen_low:
            borders.add("joined in a line")
        elif short:
            state = "short last row"
        else:
            line_open = True
            column += 1
            writes = column <= GEOMETRY.columns
            state = "in a line" if writes else "surplus pixels"
            borders |= set() if writes else {"line too long"}
            full = column == GEOMETRY.columns and row == GEOMETRY.rows - 1
        yield Step(state, writes, frozenset(borders))


def read_state(count: int) -> str:
    if count >= GEOMETRY.pixels:
        return "last pixel" if count == GEOMETRY.pixels else "wrapped"
    if not count:
        return "no clock"
    return "first row" if count < GEOMETRY.columns else "further rows"


def left_in(clocks: Sequence[Clock], stepped: Sequence[Step], end: int) -> str:
    """The state of a writer at a time in ps, from the clocks since it was started."""
    before = [index for index, clock in enumerate(clocks) if clock.rise < end]
    if len(before) < 2:
        return "reset"
    last = before[-1]
    step = stepped[last]
    return "write pulse" if step.writes and clocks[last].fall < end else step.state
