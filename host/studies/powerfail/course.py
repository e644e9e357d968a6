"""The course of a scenario without a cut: operations of the flash, and what is remembered when."""

from dataclasses import dataclass
from functools import partial

from cubestack.emulator.iss.flash_changes import FlashContents, FlashOperation
from cubestack.host.studies.copies import in_copy
from cubestack.host.studies.powerfail.rig import OBEYED, Rig, Setup, contents_after, seeded
from cubestack.host.studies.powerfail.scenario import Answers, Scenario, ScenarioError

LEARNING = 1
"""Marks random numbers of the run without cuts."""


@dataclass(frozen=True)
class Course:
    """A run without cuts; times in ps since power-up.

    Attributes:
        operations: of the flash, in the order of time.
        sent: bytes of the host, and when it began to send them.
        started: when each step began.
        settled: when what each step changes must be remembered.
        states: answers after a power-up before the first step and after each step.
        running: answers of the running device then, which may include what a power-up loses.
        end_ps: end of the last step.
    """

    operations: tuple[FlashOperation, ...]
    sent: tuple[tuple[int, bytes], ...]
    started: tuple[int, ...]
    settled: tuple[int, ...]
    states: tuple[Answers, ...]
    running: tuple[Answers, ...]
    end_ps: int

    def allowed(self, time_ps: int) -> range:
        """Indices of the states that the device may have after a cut at this time."""
        first = sum(settled <= time_ps for settled in self.settled)
        return range(first, max(first, sum(started <= time_ps for started in self.started)) + 1)

    def step_at(self, time_ps: int) -> int:
        """Index of the step during which this time is, 0 before the first one."""
        return max(0, sum(started <= time_ps for started in self.started) - 1)


def learn(setup: Setup, fresh: Rig) -> Course:
    """Run the scenario without cuts.

    Args:
        setup: what is tried.
        fresh: the same device, just powered up; copies of it are asked what it remembers.

    Raises ScenarioError if the device does not answer as the scenario says.
    """
    scenario, rig = setup.scenario, Rig(setup)
    try:
        before = FlashContents.of(rig.machine)
        rig.await_start()
        states, running = [_remembered(fresh, rig, 0)], [in_copy(rig.ask)]
        started, settled = list[int](), list[int]()
        for place, step in enumerate(scenario.step, start=1):
            rig.host.drop()
            started.append(rig.kernel.now)
            answer = rig.perform(step)
            if answer != OBEYED:
                raise ScenarioError(f"step {place} is {answer} even without a power cut")
            rig.emulated.wait(step.settle_s)
            settled.append(rig.kernel.now)
            states.append(_remembered(fresh, rig, place))
            running.append(in_copy(rig.ask))
            _compare(scenario, place, states[-1])
        done = tuple(rig.flash_operations())
        if not contents_after(before, done).same_as(rig.machine):
            raise RuntimeError("the flash changed without an operation of its controller")
        return Course(
            done,
            tuple(rig.host.sent),
            tuple(started),
            tuple(settled),
            tuple(states),
            tuple(running),
            rig.kernel.now,
        )
    finally:
        rig.close()


def _remembered(fresh: Rig, rig: Rig, place: int) -> Answers:
    """Answers of a copy of ``fresh`` that is powered up with the flash of ``rig``."""
    answers = in_copy(partial(_answers, fresh, FlashContents.of(rig.machine), place))
    for question, answer in zip(fresh.scenario.question, answers, strict=True):
        if answer is None:
            raise ScenarioError(
                f"question {question.name} has no answer after a power-up {_when(place)}, even "
                "without a power cut"
            )
    return answers


def _answers(fresh: Rig, contents: FlashContents, place: int) -> Answers:
    fresh.power_up(contents, seeded(fresh.scenario.seed, LEARNING, place))
    fresh.await_start()
    return fresh.ask()


def _compare(scenario: Scenario, place: int, answers: Answers) -> None:
    for question, answer in zip(scenario.question, answers, strict=True):
        wanted = (scenario.step[place - 1].state or {}).get(question.name, answer)
        if answer != wanted:
            raise ScenarioError(
                f"question {question.name} has the answer {answer!r} after a power-up "
                f"{_when(place)}, even without a power cut; the scenario says {wanted!r}"
            )


def _when(place: int) -> str:
    return f"after step {place}" if place else "before the first step"
