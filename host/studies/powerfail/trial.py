"""Tries cases: cuts the supply of a copy of a device, powers it up, and asks it."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from cubestack.emulator.iss.brown_out import Dip, dip_of, volts_at
from cubestack.emulator.iss.flash_changes import PAGE_BYTES, FlashContents, FlashOperation
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S
from cubestack.host.studies.copies import CopyError, in_copy
from cubestack.host.studies.powerfail.cases import (
    BROWN_OUT,
    WORN,
    Case,
    Cut,
    SecondCut,
    second_cuts,
)
from cubestack.host.studies.powerfail.course import Course
from cubestack.host.studies.powerfail.rig import OBEYED, SILENT, Rig, Setup, seeded
from cubestack.host.studies.powerfail.scenario import Answers

RIGHT = "right"
MIXED, FORGOTTEN, WRONG, UNSTABLE, STUCK = "mixed", "forgotten", "wrong", "unstable", "stuck"
FAILED = "failed"

MEANINGS = {
    RIGHT: "the device remembers what it must, and goes on",
    SILENT: "the device does not answer a question",
    FORGOTTEN: "it remembers an earlier state, although it had acknowledged a later one",
    MIXED: "it remembers parts of two states",
    WRONG: "it remembers what never was",
    UNSTABLE: "it remembers something else after another power-up",
    FAILED: "the emulator did not finish the case",
    STUCK: "it does not obey the next command, or forgets its effect",
}

TRIAL = 4
"""Marks random numbers of a case."""

VDD = 9
"""Analog input of the part: its supply."""

SUPPLY_STEPS = 40
"""Steps in which a changing supply is shown to the part."""

WORN_WORDS = 4


@dataclass(frozen=True)
class Outcome:
    """What became of a case."""

    verdict: str  #: a key of ``MEANINGS``
    answers: Answers  #: after the power-up
    detail: str = ""  #: what is wrong
    recovery: list[FlashOperation] = field(default_factory=list)  #: until it had answered


@dataclass(frozen=True)
class Row:
    """A case that was tried, for reports."""

    case: str  #: number, behind a dot that of a second cut
    kind: str
    operation: int  #: of the course
    address: int  #: of the flash that the cut operation changes; -1 for none
    erases: bool
    where: str  #: instruction that begins that operation
    time_s: float  #: of the cut, since power-up
    share: float | None  #: of the operation that was done
    verdict: str
    answers: Answers
    allowed: tuple[Answers, ...]
    detail: str
    second: bool = False

    @property
    def right(self) -> bool:
        return self.verdict == RIGHT


class Cursor:
    """Contents of the flash in the course of its operations; cheap from one to the next."""

    def __init__(self, start: FlashContents, operations: Sequence[FlashOperation]) -> None:
        self._start, self._operations = start, operations
        self._now, self._done = start.copy(), 0

    def at(self, cut: Cut, rng: np.random.Generator) -> FlashContents:
        """A copy of the contents after a cut."""
        if cut.operation < self._done:
            self._now, self._done = self._start.copy(), 0
        for one in self._operations[self._done : cut.operation]:
            self._now.apply(one)
        self._done = cut.operation
        contents = self._now.copy()
        if cut.share is not None:
            contents.tear(self._operations[cut.operation], cut.share, rng)
        return contents


class Tester:
    """Tries the cases of one set-up.

    ``fresh`` is a device that was just powered up; each case runs in a copy of it.
    """

    def __init__(self, setup: Setup, course: Course, fresh: Rig) -> None:
        self._setup, self._scenario, self._course, self._fresh = (
            setup, setup.scenario, course, fresh,
        )  # fmt: skip
        self._start = FlashContents.of(fresh.machine)
        self._cursor = Cursor(self._start, course.operations)

    def perform(self, cases: Iterable[Case]) -> Iterator[list[Row]]:
        """Try them; yields the rows of each case, its second cuts behind it."""
        dips = list[Case]()
        for case in cases:
            if case.kind == BROWN_OUT:
                dips.append(case)
            elif case.kind == WORN:
                yield [self.row(case, _tried(partial(self.wear, self._fresh, case)))]
            else:
                yield list(self._cut(case))
        yield from self._brown_outs(dips)

    def contents(self, case: Case) -> FlashContents:
        """Of the flash after its cut."""
        return self._cursor.at(case.cut, self.random(case, 0))

    def second_contents(
        self, case: Case, recovery: Sequence[FlashOperation], second: SecondCut
    ) -> FlashContents:
        rng = self.random(case, 2 + 2 * second.number)
        return Cursor(self.contents(case), recovery).at(second.cut, rng)

    def random(self, case: Case, purpose: int) -> np.random.Generator:
        return seeded(self._scenario.seed, TRIAL, case.number, purpose)

    def _cut(self, case: Case) -> Iterator[Row]:
        contents = self.contents(case)
        outcome = _tried(partial(self.recover, self._fresh, contents, case))
        yield self.row(case, outcome)
        for second in second_cuts(self._scenario, case, outcome.recovery):
            again = self.second_contents(case, outcome.recovery, second)
            found = _tried(partial(self.recover, self._fresh, again, case, second))
            yield self.row(case, found, second, outcome.recovery)

    def recovery(self, case: Case) -> list[FlashOperation]:
        """What the device writes to its flash when it is powered up after a case's first cut."""
        return _tried(partial(self.recover, self._fresh, self.contents(case), case)).recovery

    def recover(
        self, rig: Rig, contents: FlashContents, case: Case, second: SecondCut | None = None
    ) -> Outcome:
        """Power a device up with this flash, and examine it."""
        rng = self.random(case, 1 if second is None else 3 + 2 * second.number)
        rig.flash_operations()
        rig.power_up(contents, rng)
        return self.examine(rig, case, rng)

    def examine(
        self, rig: Rig, case: Case, rng: np.random.Generator, *, kept: bool = False
    ) -> Outcome:
        """Ask a device that starts, ask it again after a power-up, and let it go on.

        ``kept``: RAM kept its contents, so the device may answer as it did before the reset.
        """
        rig.await_start()
        answers = rig.ask()
        recovery = rig.flash_operations()
        allowed = self._course.allowed(case.time_ps)
        if kept and answers in self._course.running[allowed.start : allowed.stop]:
            verdict, detail = RIGHT, ""
        else:
            verdict, detail = self._judge(answers, allowed)
        if verdict == RIGHT:
            verdict, detail = self._follow(rig, None if kept else answers, allowed, rng)
        return Outcome(verdict, answers, detail, recovery)

    def _judge(self, answers: Answers, allowed: range) -> tuple[str, str]:
        """Verdict, and what is wrong."""
        states = self._course.states
        right = [states[state] for state in allowed]
        if answers in right:
            return RIGHT, ""
        if None in answers:
            questions = zip(self._scenario.question, answers, strict=True)
            silent = ", ".join(one.name for one, answer in questions if answer is None)
            return SILENT, f"no answer to {silent}"
        if answers in states[: allowed.start]:
            return FORGOTTEN, f"as after step {states.index(answers)} of {allowed.start}"
        if all(answer in known for answer, *known in zip(answers, *right, strict=True)):
            return MIXED, f"parts of {len(right)} states"
        return WRONG, "a state that never was"

    def _follow(
        self, rig: Rig, answers: Answers | None, allowed: range, rng: np.random.Generator
    ) -> tuple[str, str]:
        """Power the device up again, repeat the step that was cut, and power it up once more."""
        again, states = _cycle(rig, rng), self._course.states
        if answers not in (None, again) or self._judge(again, allowed)[0] != RIGHT:
            return UNSTABLE, f"after another power-up {_told(again)}"
        state = next(one for one in allowed if states[one] == again)
        if state == len(self._scenario.step):
            return RIGHT, ""
        first = state  # steps before it that only change RAM must be repeated too
        while first and states[first - 1] == again:
            first -= 1
        for place in range(first, state + 1):
            step = self._scenario.step[place]
            answer = rig.perform(step)
            if answer != OBEYED:
                return STUCK, f"step {place + 1}, repeated, is {answer}"
            rig.emulated.wait(step.settle_s)
        after = _cycle(rig, rng)
        if after != states[state + 1]:
            return STUCK, f"after step {state + 1}, repeated, {_told(after)}"
        return RIGHT, ""

    # Brown-outs

    def _brown_outs(self, cases: Sequence[Case]) -> Iterator[list[Row]]:
        """Cases in the order of their time: copies of a device that runs the scenario."""
        if not cases:
            return
        rig = Rig(self._setup)
        try:
            player = Player(rig, self._course)
            starts = [(max(0, case.time_ps - self._dip(case).reset_ps), case) for case in cases]
            for start, case in sorted(starts, key=lambda one: (one[0], one[1].number)):
                player.play(start)
                yield [self.row(case, _tried(partial(self.brown_out, player, case)))]
        finally:
            rig.close()

    def _dip(self, case: Case) -> Dip:
        found = dip_of(self._scenario.brown_out[case.curve].curve)
        assert found is not None
        return found

    def brown_out(
        self, player: "Player", case: Case, at_cut: Callable[[], None] = lambda: None
    ) -> Outcome:
        """Let the supply dip; ``at_cut`` is called at the instruction where the reset begins."""
        rng, curve = self.random(case, 1), self._scenario.brown_out[case.curve].curve
        dip, rig = self._dip(case), player.rig
        start = case.time_ps - dip.reset_ps
        supply = [
            (start + round(ms * PS_PER_MS), volts_at(curve, ms))
            for ms in np.linspace(curve[0][0], curve[-1][0], SUPPLY_STEPS).tolist()
        ]
        for at, volts in supply:
            if at < case.time_ps:
                player.play(at)
                _set_supply(rig, volts)
        player.play(case.time_ps)
        at_cut()
        contents = self._torn(rig, case)
        contents.load(rig.machine)
        rig.restart(dip.cause)
        rig.machine.hang()  # the reset lasts
        release = start + dip.release_ps
        for at, volts in supply:
            if case.time_ps <= at < release:
                rig.kernel.advance_to(at)
                _set_supply(rig, volts)
        rig.kernel.advance_to(release)
        if dip.forgets:
            rig.power_up(contents, rng)
        else:
            rig.restart(dip.cause)
        _set_supply(rig, supply[-1][1])
        return self.examine(rig, case, rng, kept=not dip.forgets)

    def _torn(self, rig: Rig, case: Case) -> FlashContents:
        """The flash now, with the operation that is under way torn."""
        done = rig.flash_operations()
        now = case.time_ps
        if not done or not done[-1].time_ps <= now < done[-1].end_ps:
            return FlashContents.of(rig.machine)
        share = (now - done[-1].time_ps) / (done[-1].end_ps - done[-1].time_ps)
        return Cursor(self._start, done).at(Cut(len(done) - 1, share), self.random(case, 0))

    # Worn pages

    def wear(self, rig: Rig, case: Case, at_wear: Callable[[], None] = lambda: None) -> Outcome:
        """Run the scenario with cells that keep their value from one step on.

        ``at_wear`` is called when that step begins.
        """
        rng, step_at = self.random(case, 1), self._course.step_at(case.time_ps)
        states, last = self._course.states, 0
        allowed = [states[0]]
        rig.await_start()
        for place, step in enumerate(self._scenario.step):
            if place == step_at:
                self._wear_out(rig, case, rng)
                at_wear()
            answer = rig.perform(step)
            if answer == SILENT:
                return Outcome(SILENT, (), f"step {place + 1} has no answer")
            rig.emulated.wait(step.settle_s)
            last, allowed = place + 1, [states[place + 1]]
            if answer != OBEYED:  # what later steps store is not what they store in the course
                allowed = [states[place], states[place + 1]]
                break
        answers = _cycle(rig, rng)
        if None in answers:
            return Outcome(SILENT, answers, "no answer after a power-up")
        if answers in allowed:
            return Outcome(RIGHT, answers)
        return Outcome(FORGOTTEN, answers, f"not as after step {last}, with worn cells")

    def _wear_out(self, rig: Rig, case: Case, rng: np.random.Generator) -> None:
        page = self._course.operations[case.cut.operation].first.address
        used = {
            change.address
            for one in self._course.operations
            for change in one.changes
            if not change.erased and page <= change.address < page + PAGE_BYTES
        }
        words = sorted(used) or list(range(page, page + PAGE_BYTES, 4))
        for address in rng.choice(words, min(WORN_WORDS, len(words)), replace=False):
            rig.machine.wear_out(int(address), 1 << int(rng.integers(32)))

    def row(
        self,
        case: Case,
        outcome: Outcome,
        second: SecondCut | None = None,
        recovery: Sequence[FlashOperation] = (),
    ) -> Row:
        """The row of a case, or of a second cut during ``recovery``."""
        cut, operations = (
            (case.cut, self._course.operations) if second is None else (second.cut, recovery)
        )
        hit = operations[cut.operation].first if cut.operation < len(operations) else None
        return Row(
            case=f"{case.number}" if second is None else f"{case.number}.{second.number}",
            kind=case.kind,
            operation=case.cut.operation,
            address=-1 if hit is None else hit.address,
            erases=hit is not None and bool(hit.erased),
            where="" if hit is None else self._fresh.symbols.describe(hit.pc),
            time_s=case.time_ps / PS_PER_S,
            share=cut.share,
            verdict=outcome.verdict,
            answers=outcome.answers,
            allowed=tuple(self._course.states[one] for one in self._course.allowed(case.time_ps)),
            detail=outcome.detail,
            second=second is not None,
        )


def _tried(act: Callable[[], Outcome]) -> Outcome:
    """Outcome of ``act`` in a copy of this process."""
    try:
        return in_copy(act)
    except CopyError as error:
        return Outcome(FAILED, (), str(error))


class Player:
    """Runs a device with what the host sent in the course of a scenario."""

    def __init__(self, rig: Rig, course: Course) -> None:
        self.rig = rig
        self._sent = list(course.sent)

    def play(self, until_ps: int) -> None:
        """Run up to a time."""
        kernel = self.rig.kernel
        while self._sent and self._sent[0][0] <= until_ps:
            at, data = self._sent.pop(0)
            kernel.advance_to(at)
            self.rig.host.write(data)
        kernel.advance_to(until_ps)


def _cycle(rig: Rig, rng: np.random.Generator) -> Answers:
    """Answers after a cut while nothing happens."""
    rig.power_up(None, rng)
    rig.await_start()
    return rig.ask()


def _set_supply(rig: Rig, volts: float) -> None:
    rig.machine.analog[VDD] = volts
    rig.processor.change_inputs(rig.machine.analog_changed)


def _told(answers: Answers) -> str:
    return ", ".join("no answer" if one is None else repr(one) for one in answers)
