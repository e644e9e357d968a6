"""Proves in which states of its other pins a camera's pins have no effect on a user's design.

Two copies of the design start in the same state, any state, with the same levels of all pins but
those of one camera. If they stay in the same state, with the same outputs, an engine may skip that
camera's clocks. Yosys converts all clocks and asynchronous resets into steps of one time and its
SAT solver searches for a counterexample.

Before an engine changes a control, it sets the clock and the syncs to their true levels, so the
copies agree about these when a control changes: a control that switches a clock makes no edge of
its own.
"""

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.flow.tools import ToolError, yosys_files
from cubestack.hdl.user.copies import Copies, Cube, IdleCamera

#: Time-out of a proof in seconds.
LIMIT = 60

#: Refuted states after which no state counts as proved.
REFUTED = 6

_PROVE = """
read_rtlil flat.il
read_verilog -formal -icells harness.v
hierarchy -top harness
proc
flatten
chformal -lower
clk2fflogic
opt_expr
opt_clean
tee -o sat.txt sat -seq 2 -prove-skip 1 -prove-asserts -show {show} -timeout {limit}
"""

_SAME = "assert(~(idle & idle_1 & calm & same_1) | same)"

_STEP = re.compile(r"^ +2 \\(\w+) .* ([01x-]+)$", re.MULTILINE)


class IdleVerdict(NamedTuple):
    """The levels for which a camera's clocks may be skipped, and a reason for the others."""

    cubes: Sequence[Cube]
    refuted: Sequence[Cube] = ()
    moves: str = ""  #: what the camera's pins change in the first one refuted


def cubes_without(
    camera: str, storing: Callable[[Callable[[str], int]], Collection[str]]
) -> list[Cube]:
    """The levels of pins for which ``storing`` does not name ``camera``."""
    found: list[Cube] = []

    def explore(known: dict[str, int]) -> None:
        class NeededError(Exception):
            pass

        def level(name: str) -> int:
            if name not in known:
                raise NeededError(name)
            return known[name]

        try:
            idle = camera not in storing(level)
        except NeededError as error:
            for value in (0, 1):
                explore({**known, str(error): value})
            return
        if idle:
            found.append(dict(known))

    explore({})
    return found


def prove_idle(
    component: PinnedComponent,
    camera: IdleCamera,
    cubes: Iterable[Cube],
    data_outputs: Mapping[str, str],
) -> IdleVerdict:
    """Prove for which of ``cubes``, levels of the other pins, the camera's pins have no effect.

    ``data_outputs`` are outputs whose level has no effect while another output, the enable, is 0.
    Raises ToolMissingError without a Yosys, TimeoutError after ``LIMIT``.
    """
    copies = Copies(component, camera, data_outputs)
    proved, refuted, moves = [*cubes], list[Cube](), ""
    pins = [*dict.fromkeys(pin for cube in proved for pin in cube)]
    show = ",".join(("before", "after", *(f"at_{pin}" for pin in pins)))
    while proved and len(refuted) < REFUTED:
        files = copies.files(proved, pins, _SAME)
        try:
            _, report = yosys_files(_PROVE.format(limit=LIMIT, show=show), files, "sat.txt")
        except ToolError as error:
            return IdleVerdict([], [*cubes], f"the proof ended with an error ({error})")
        if "proof finished - no model found: SUCCESS" in report:
            return IdleVerdict(proved, refuted, moves)
        if "proof finished - model found: FAIL" not in report:
            raise TimeoutError(f"no proof within {LIMIT} s")
        levels = dict(_STEP.findall(report))
        moves = moves or _first_difference(copies.names, levels["before"], levels["after"])
        now = {pin: int(levels[f"at_{pin}"] == "1") for pin in pins}
        refuted += [cube for cube in proved if cube.items() <= now.items()]
        proved = [cube for cube in proved if not cube.items() <= now.items()]
    return IdleVerdict([], [*cubes], moves)


def _first_difference(names: list[str], before: str, after: str) -> str:
    """What differs in the last step: a register, else an output."""
    width = min(len(before), len(after))
    different = [n for n in range(width) if before[-1 - n] != after[-1 - n]]
    for place in different:
        if place < len(names):
            return f"register {names[place]}"
    return "an output"
