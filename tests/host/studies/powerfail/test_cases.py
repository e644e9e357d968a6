"""Which cases a scenario has, and what the device may remember after each."""

from collections import Counter

from cubestack.emulator.iss.flash_changes import FlashChange, FlashOperation
from cubestack.host.studies.powerfail.cases import (
    AFTER,
    BEFORE,
    BETWEEN,
    BROWN_OUT,
    TORN,
    WORN,
    cases_of,
    every_second_cut,
    second_cuts,
)
from cubestack.host.studies.powerfail.course import Course
from cubestack.host.studies.powerfail.scenario import BrownOut, Question, Scenario, Step


def operation(time_ps: int, *, erases: bool = False) -> FlashOperation:
    return FlashOperation((FlashChange(time_ps, 20, 0x8_0000, 4, 0, 0, 0x100, erases),))


COURSE = Course(
    operations=(operation(100, erases=True), operation(200), operation(300)),
    sent=((50, b"a"), (250, b"b")),
    started=(50, 250),
    settled=(230, 350),
    states=(("0",), ("1",), ("2",)),
    running=(("0",), ("1",), ("2",)),
    end_ps=400,
)


def scenario(**more: object) -> Scenario:
    keys: dict[str, object] = {
        "device": "cubestar",
        "question": (Question(name="q", send="g"),),
        "step": (Step(send="a", answer="k"), Step(send="b", answer="k")),
    }
    return Scenario(**(keys | more))  # type: ignore[arg-type]


def test_every_operation_is_cut_before_in_the_middle_and_after() -> None:
    cases = cases_of(scenario(torn=2, between=0, worn=1), COURSE)
    assert Counter(case.kind for case in cases) == {BEFORE: 3, TORN: 6, AFTER: 3, WORN: 1}
    assert [case.number for case in cases] == list(range(len(cases)))
    first = [(case.kind, case.time_ps, case.cut.share) for case in cases[:4]]
    assert first == [(BEFORE, 100, None), (TORN, 105, 0.25), (TORN, 115, 0.75), (AFTER, 120, None)]


def test_cuts_between_operations_lie_between_them() -> None:
    cases = [one for one in cases_of(scenario(between=5), COURSE) if one.kind == BETWEEN]
    assert len(cases) == 20
    for case in cases:
        done = case.cut.operation
        start = COURSE.operations[done - 1].end_ps if done else 0
        end = COURSE.operations[done].time_ps if done < 3 else COURSE.end_ps
        assert start <= case.time_ps < end
    assert cases == [one for one in cases_of(scenario(between=5), COURSE) if one.kind == BETWEEN]


def test_each_brown_out_is_tried_at_each_operation() -> None:
    dip = BrownOut(curve=((0.0, 3.3), (1.0, 1.0), (2.0, 3.3)))
    cases = cases_of(scenario(brown_out=(dip, dip)), COURSE)
    dips = [(one.curve, one.time_ps) for one in cases if one.kind == BROWN_OUT]
    assert dips == [(0, 110), (0, 210), (0, 310), (1, 110), (1, 210), (1, 310)]


def test_only_a_step_under_way_leaves_a_choice_of_states() -> None:
    allowed = {time: list(COURSE.allowed(time)) for time in (0, 49, 50, 229, 230, 250, 349, 350)}
    assert allowed == {
        0: [0], 49: [0], 50: [0, 1], 229: [0, 1], 230: [1], 250: [1, 2], 349: [1, 2], 350: [2],
    }  # fmt: skip


def test_second_cuts_are_a_repeatable_choice() -> None:
    recovery = [operation(time) for time in range(0, 1000, 50)]
    plan = scenario(second=4, torn=1)
    case = cases_of(plan, COURSE)[3]
    every = every_second_cut(plan, recovery)
    assert len(every) == 40
    chosen = second_cuts(plan, case, recovery)
    assert len(chosen) == 4
    assert all(one == every[one.number] for one in chosen)
    assert chosen == second_cuts(plan, case, recovery)
    assert second_cuts(plan, case, recovery[:1]) == every_second_cut(plan, recovery[:1])
    assert second_cuts(scenario(second=0), case, recovery) == []
