"""Replays one case, with gdb at the instruction that it cuts."""

from collections.abc import Callable

from cubestack.emulator.iss.flash_changes import FlashOperation
from cubestack.emulator.ports.gdb import GdbEndpoint
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.host.emulation.records import open_gdb
from cubestack.host.studies.powerfail.cases import (
    BEFORE,
    BROWN_OUT,
    TORN,
    WORN,
    Case,
    SecondCut,
    cases_of,
    every_second_cut,
)
from cubestack.host.studies.powerfail.course import Course
from cubestack.host.studies.powerfail.rig import Rig, Setup
from cubestack.host.studies.powerfail.run import fresh_rig
from cubestack.host.studies.powerfail.trial import Player, Row, Tester

LONGEST_STORE = 64
"""Cycles that a store to a peripheral takes at most, with all waits."""

SERVE_S = 0.02
"""Longest wait for the client at a time."""


class Witness:
    """Sees a replay; this one does nothing."""

    def at_cut(self, rig: Rig) -> None:
        """The device is at the instruction that the cut hits, before it."""

    def ended(self, rig: Rig, row: Row) -> None:
        """The device has been asked."""


def _approach(rig: Rig, operation: FlashOperation, run: Callable[[int], None]) -> None:
    """Run up to the instruction that begins an operation, which takes a few cycles itself."""
    for cycles in range(LONGEST_STORE, 0, -1):
        run(operation.time_ps - cycles * PS_PER_S // rig.machine.hz - 1)  # times are rounded
        if rig.machine.register("pc") == operation.first.pc:
            return


class Gdb(Witness):
    """Serves gdb, and lets the device run only when its client does."""

    def __init__(self, port: int, tell: Callable[[str], None]) -> None:
        """Serve on ``port`` of this machine, 0 for any; ``tell`` receives lines for the user."""
        self._port, self._tell = port, tell
        self._endpoint: GdbEndpoint | None = None

    def at_cut(self, rig: Rig) -> None:
        endpoint = self._endpoint = open_gdb(rig.emulated, self._port, wait=True)
        where = rig.symbols.describe(rig.machine.register("pc"))
        self._tell(f"the power fails at {where}")
        self._tell(f"target remote {endpoint.name}")
        while rig.kernel.paused:
            endpoint.serve(SERVE_S)

    def ended(self, rig: Rig, row: Row) -> None:
        self._tell(f"case {row.case} is {row.verdict}; gdb is served until its client leaves")
        assert self._endpoint is not None
        if self._endpoint.connected and rig.processor.debugger is not None:
            rig.processor.debugger.program_ended()
        while self._endpoint.connected:
            self._endpoint.serve(SERVE_S)


def replay(setup: Setup, course: Course, name: str, witness: Witness) -> Row:
    """Run a case again; ``name`` is its number, behind a dot that of its second cut.

    Raises ValueError for an unknown case.
    """
    case, number = _case(setup, course, name)
    tester = Tester(setup, course, fresh_rig(setup))
    second = None if number is None else _second(tester, setup, case, number)
    rig = Rig(setup)
    try:
        if second is None:
            row = _replay_first(tester, rig, course, case, witness)
        else:
            row = _replay_second(tester, rig, case, second, witness)
        witness.ended(rig, row)
        return row
    finally:
        rig.close()


def _case(setup: Setup, course: Course, name: str) -> tuple[Case, int | None]:
    first, dot, second = name.partition(".")
    cases = cases_of(setup.scenario, course)
    if not first.isdecimal() or (dot and not second.isdecimal()):
        raise ValueError(f"a case is a number like 12 or 12.3, not {name!r}")
    if int(first) >= len(cases):
        raise ValueError(f"there are cases 0 to {len(cases) - 1}, not {first}")
    return cases[int(first)], int(second) if dot else None


def _second(tester: Tester, setup: Setup, case: Case, number: int) -> SecondCut:
    cuts = every_second_cut(setup.scenario, tester.recovery(case))
    if number >= len(cuts):
        raise ValueError(f"case {case.number} has {len(cuts)} second cuts, from 0, not {number}")
    return cuts[number]


def _replay_first(tester: Tester, rig: Rig, course: Course, case: Case, witness: Witness) -> Row:
    def at_cut() -> None:
        witness.at_cut(rig)

    if case.kind == WORN:
        return tester.row(case, tester.wear(rig, case, at_cut))
    player = Player(rig, course)
    if case.kind == BROWN_OUT:
        return tester.row(case, tester.brown_out(player, case, at_cut))
    if case.kind in (BEFORE, TORN):
        _approach(rig, course.operations[case.cut.operation], player.play)
    else:
        player.play(case.time_ps)
    at_cut()
    player.play(case.time_ps)
    return tester.row(case, tester.recover(rig, tester.contents(case), case))


def _replay_second(
    tester: Tester, rig: Rig, case: Case, second: SecondCut, witness: Witness
) -> Row:
    recovery, cut = tester.recovery(case), second.cut
    rig.power_up(tester.contents(case), tester.random(case, 1))
    if cut.share is None:
        rig.kernel.advance_to(second.time_ps)
    else:
        _approach(rig, recovery[cut.operation], rig.kernel.advance_to)
    witness.at_cut(rig)
    rig.kernel.advance_to(second.time_ps)
    contents = tester.second_contents(case, recovery, second)
    return tester.row(case, tester.recover(rig, contents, case, second), second, recovery)
