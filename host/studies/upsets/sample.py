"""One upset in a copy of the running device: its effect and the firmware's answer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from cubestack.emulator.faults.sites import Sites
from cubestack.host.devices.experiment import Result
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.errors import HostError
from cubestack.host.studies.upsets.clean import CleanLoop, Snapshot, take
from cubestack.host.studies.upsets.subject import Answer, PortWatch, Subject, UpsetVerdict

AHEAD_PS = 2_000_000
"""Lead time of a copy before its upset: no processor step takes the FPGAs past it."""

LOOPS = 3
"""Loops after the hit one that count for recovery."""

PIXELS = 2
"""Bytes of a single pixel's upset: itself and its replacement."""

Effect = Literal[
    "nothing", "left over", "pixel", "row", "picture", "late", "no ACK", "contention", "timing"
]
EFFECTS: tuple[Effect, ...] = get_args(Effect)
"""Effects of an upset as the processor sees them; "left over" remains unseen in a register or
memory after the loop; "late" is right, but at another time."""


@dataclass(frozen=True)
class UpsetTarget:
    """A bit: of a register of the FPGAs, or anywhere in a memory."""

    name: str  #: path of the register, or name of the memory
    bit: int  #: of the register; of a memory counted through its bytes
    memory: bool = False  #: whether it is a memory


@dataclass(frozen=True)
class UpsetResult(Result):
    """Attributes are those of the JSON output."""

    #: target, bit, memory: as ``UpsetTarget`` has them
    target: str
    bit: int
    memory: bool
    phase: str  #: of the loop, in which it was hit
    time_s: float  #: virtual time of the upset
    effect: Effect  #: one of `EFFECTS`
    answer: Answer  #: of the loop that was hit: right, refused or wrong
    reason: str  #: of a refusal
    #: loops until an answer was right; 0 the one that was hit, None later than `LOOPS`
    recovered: int | None
    phases_s: Mapping[str, float]  #: how long the FPGAs are in each phase from one loop to the next
    period_s: float  #: from one loop to the next
    bits: int  #: of the whole register or memory
    hits_a_day: float  #: upsets of one bit a day, by flux and cross-section

    @property
    def right(self) -> bool:
        return self.answer == "right"

    @property
    def solved(self) -> bool:
        """Whether there was an answer, right or wrong."""
        return self.answer != "refused"

    @property
    def ending(self) -> str:
        return self.reason or self.effect


@dataclass(frozen=True)
class Running:
    """A device within a loop whose clean course is known."""

    emulated: AnyEmulated
    subject: Subject
    sites: Sites
    watch: PortWatch
    clean: CleanLoop


@dataclass(frozen=True)
class Upset:
    """A bit and the time of its flip."""

    time_ps: int
    phase: str
    target: UpsetTarget


@dataclass(frozen=True)
class Outcome:
    """Effect of an upset; attributes as in ``UpsetResult``."""

    effect: Effect
    verdict: UpsetVerdict
    recovered: int | None


def followed(running: Running, upsets: Sequence[Upset]) -> list[Outcome]:
    """Effects of upsets up to the first that leaves a trace; for use in a copy.

    An upset without a trace, as in a register in reset, leaves the device ready for the next one.
    """
    outcomes = list[Outcome]()
    for one in upsets:
        if _left_a_trace(running, one):
            return [*outcomes, _followed(running)]
        outcomes.append(Outcome("nothing", running.clean.verdict, 0))
    return outcomes


def _left_a_trace(running: Running, upset: Upset) -> bool:
    """Flip the bit at its time; returns whether anything differs."""
    emulated, target = running.emulated, upset.target
    kernel, engine = emulated.board.kernel, running.sites.engine
    assert engine is not None
    kernel.advance_to(upset.time_ps - AHEAD_PS)
    if target.memory:
        kernel.advance_to(upset.time_ps)
        place = {"address": target.bit // 8, "bit": target.bit % 8}
        emulated.faults.inject("memory-flip", target=target.name, **place)
        return True
    engine.flip(target.name, target.bit, max(upset.time_ps, engine.now_ps))
    kernel.advance_to(upset.time_ps + AHEAD_PS)
    engine.run(max(kernel.now, engine.now_ps))
    return engine.flip_changed


def _followed(running: Running) -> Outcome:
    clean = running.clean
    running.emulated.board.kernel.advance_to(clean.over_ps)
    found = take(running.sites, running.watch)
    effect = effect_of(found, clean.snapshot, running.subject.row_bytes)
    if effect == "nothing" or (effect == "left over" and _out_of_sight(found, running)):
        return Outcome(effect, clean.verdict, 0)
    running.watch.clear()
    verdict = _judged(running)
    loop, answer = 0, verdict.answer
    while answer != "right" and loop < LOOPS:
        loop += 1
        answer = _judged(running, again=True).answer
    return Outcome(effect, verdict, loop if answer == "right" else None)


def _out_of_sight(found: Snapshot, running: Running) -> bool:
    """Whether only memory bytes differ that the processor does not read again."""
    clean, engine = running.clean.snapshot, running.sites.engine
    assert engine is not None
    return found.registers == clean.registers and all(
        name in engine.memories or np.array_equal(found.memories[name], clean.memories[name])
        for name in clean.memories
    )


def _judged(running: Running, *, again: bool = False) -> UpsetVerdict:
    kernel, clean = running.emulated.board.kernel, running.clean
    try:
        end_ps = clean.end_ps
        if again:
            end_ps = kernel.now + clean.end_ps - clean.start_ps
            running.subject.start(running.emulated)
        kernel.advance_to(end_ps)  # earlier it would answer that it is busy
        return running.subject.judge(running.emulated)
    except HostError as error:
        return UpsetVerdict("refused", type(error).__name__)


def effect_of(found: Snapshot, clean: Snapshot, row_bytes: int) -> Effect:
    if _rises(found) < _rises(clean):
        return "no ACK"
    broken = {
        kind for kind, count in found.violations.items() if count > clean.violations.get(kind, 0)
    }
    if broken:
        return "contention" if any("contention" in kind for kind in broken) else "timing"
    if len(found.data) != len(clean.data):
        return "picture"
    differ = np.flatnonzero(found.data != clean.data)
    if differ.size:
        if differ.size <= PIXELS:
            return "pixel"
        return "row" if differ[-1] - differ[0] < row_bytes else "picture"
    if found.seen != clean.seen:
        return "late"
    same = found.registers == clean.registers and all(
        np.array_equal(found.memories[name], clean.memories[name]) for name in clean.memories
    )
    return "nothing" if same else "left over"


def _rises(snapshot: Snapshot) -> int:
    return sum(level for _, _, level in snapshot.seen)
