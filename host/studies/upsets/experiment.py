"""Flips every bit of a device at random times in every phase of its loop."""

import gc
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cache, partial
from typing import Any

import numpy as np

from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.values import positive, text, whole
from cubestack.host.devices.experiment import Experiment, Section
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.experiments.opener import Opener
from cubestack.host.experiments.rates import wilson
from cubestack.host.options import Options
from cubestack.host.pictures.figures import effects
from cubestack.host.studies.copies import in_copy
from cubestack.host.studies.upsets.atlas import HEAD, atlas, lines, rows
from cubestack.host.studies.upsets.clean import PS_PER_S, CleanLoop, Interval, clean_loop, render
from cubestack.host.studies.upsets.sample import (
    AHEAD_PS,
    EFFECTS,
    Outcome,
    Running,
    Upset,
    UpsetResult,
    UpsetTarget,
    followed,
)
from cubestack.host.studies.upsets.subject import PortWatch, Rig, Subject

AT_ONCE = 200
"""Largest number of upsets per copy."""

S_PER_DAY = 86_400

SCENES = 200
"""Number of scenes to try for a right measurement; some profiles seldom give one."""


@dataclass(frozen=True, kw_only=True)
class UpsetOptions(Options):
    """Options of `cubestack upsets DEVICE`."""

    frames: int = whole(1, "upsets of each bit in each phase (default 1)", 1)
    seed: int = whole(0, "seed of everything random (default 0)", 0)
    registers: str = text(
        "*", "only registers whose path matches, e.g. 'writer.*'", metavar="PATTERN"
    )
    memories: str = text(
        "", "memories to hit, e.g. 'ram,flash' (default: those that hold images)", metavar="NAMES"
    )
    memory_bits: int = whole(
        8, "random bits of each memory, besides all bits of the registers (default 8)", 0
    )
    flux: float = positive(1.0, "particles per cm2 and second (default 1), for rates per day")
    cross_section: float = positive(
        1e-13, "cross-section of a bit in cm2 (default 1e-13), for rates per day", metavar="CM2"
    )


@dataclass(frozen=True)
class UpsetExperiment(Experiment[Opener[Any, Any], UpsetOptions, UpsetResult]):
    """Upsets of one device."""

    rig: Callable[[Any], Rig]  #: the subject, by the options
    description: str  #: for the help
    decides: tuple[str, ...] = ()  #: board options that the rig sets
    options: type[UpsetOptions] = UpsetOptions  #: including those that choose the rig

    title = "upsets, their effects, and the firmware's answers"
    columns = ("upset", "bit", "phase", "effect", "answer", "right after", "")
    label = "flipping bits"

    def count(self, options: UpsetOptions) -> int:
        """Each bit in each phase, as often as asked."""
        rig = self.rig(options)
        return options.frames * len(rig.phases) * len(_targets(rig, options))

    def run(self, opened: Opener[Any, Any], options: UpsetOptions) -> Iterator[UpsetResult]:
        """Yield one result for each upset, in the order of time."""
        rng = np.random.default_rng(options.seed)
        rig = self.rig(options)
        subject = rig.subjects[int(rng.integers(len(rig.subjects)))]
        with opened(subject.scene(rng), seed=options.seed, **rig.board) as emulated:
            subject.ready(emulated)
            sites = emulated.board.sites()
            watch = PortWatch(sites.engine, sites.engine.wiring.acknowledges)
            if not emulated.board.firmware:  # machine code bypasses the watched engine
                emulated.board.processor.fpga = watch
            clean = _begin(emulated, subject, sites, watch, rng)
            render(clean, sites)
            sizes = dict(sites.engine.registers)
            sizes |= {name: 8 * memory.size for name, memory in sites.all_memories().items()}
            targets = _targets(rig, options)
            _check(targets, sizes)
            upsets = [
                Upset(_moment(clean.intervals, phase, rng), phase, _drawn(target, sizes, rng))
                for phase in rig.phases
                for target in targets
                for _ in range(options.frames)
            ]
            upsets.sort(key=lambda each: each.time_ps)
            hits_a_day = options.flux * options.cross_section * S_PER_DAY
            about = _About(clean, subject.period_s, sizes, hits_a_day)
            running = Running(emulated, subject, sites, watch, clean)
            gc.freeze()  # garbage collection would write to memory that the copies share
            while upsets:
                emulated.board.kernel.advance_to(upsets[0].time_ps - AHEAD_PS)
                outcomes = in_copy(partial(followed, running, upsets[:AT_ONCE]))
                for one, outcome in zip(upsets, outcomes, strict=False):
                    yield about.result(one, outcome)
                del upsets[: len(outcomes)]

    def row(self, number: int, result: UpsetResult) -> tuple[str, ...]:
        later = {0: "at once", None: "never"}.get(result.recovered, f"{result.recovered} loops")
        return (
            *(result.target, str(result.bit), result.phase, result.effect, result.answer, later),
            result.reason,
        )

    def summarise(self, results: Sequence[UpsetResult], wall_s: float) -> Iterable[str]:
        yield from lines(results)

    def sections(self, results: Iterable[Mapping[str, Any]]) -> Iterator[Section]:
        """The atlas: a table and a figure of registers and memories."""
        parts = atlas(UpsetResult(**each) for each in results)
        yield Section("upsets by register and memory", HEAD, list(rows(parts)))
        named = [(part.name, len(part.results)) for part in parts]
        counts = {effect: [part.effects[effect] for part in parts] for effect in EFFECTS}
        seen = [wilson(part.seen, len(part.results)) for part in parts]
        figure = effects(named, counts, seen, "upsets, in all phases alike")
        yield Section("what they do", png=figure)


def _targets(rig: Rig, options: UpsetOptions) -> list[UpsetTarget]:
    """Every bit of every register, and undrawn bits of memories."""
    known = _registers(rig.wiring)
    registers = [
        UpsetTarget(name, bit)
        for name, bits in known.items()
        if fnmatchcase(name, options.registers)
        for bit in range(bits)
    ]
    if not registers:
        raise ValueError(f"no register is like {options.registers!r}; there are {', '.join(known)}")
    return registers + [
        UpsetTarget(name, 0, memory=True)
        for name in (options.memories.split(",") if options.memories else rig.memories)
        for _ in range(options.memory_bits)
    ]


def _begin(
    emulated: AnyEmulated,
    subject: Subject,
    sites: Sites,
    watch: PortWatch,
    rng: np.random.Generator,
) -> CleanLoop:
    """Start a loop that ends rightly without upsets; returns its course."""
    for _ in range(SCENES):
        subject.start(emulated)
        subject.judge(emulated)  # now settings and buffers are as in operation
        watch.clear()
        subject.start(emulated)
        clean = in_copy(partial(clean_loop, emulated, subject, sites, watch))
        if clean.verdict.answer == "right":
            return clean
        subject.judge(emulated)
        emulated.scene = subject.scene(rng)
    raise ValueError(f"{emulated.device.name} measures none of {SCENES} scenes rightly")


@dataclass(frozen=True)
class _About:
    """Values that all results of a run share."""

    clean: CleanLoop
    period_s: float
    bits: Mapping[str, int]
    hits_a_day: float

    def result(self, one: Upset, outcome: Outcome) -> UpsetResult:
        target, verdict = one.target, outcome.verdict
        return UpsetResult(
            *(target.name, target.bit, target.memory, one.phase, one.time_ps / PS_PER_S),
            *(outcome.effect, verdict.answer, verdict.reason, outcome.recovered),
            *(
                self.clean.seconds(self.period_s),
                self.period_s,
                self.bits[target.name],
                self.hits_a_day,
            ),
        )


@cache
def _registers(wiring: Callable[[], Wiring]) -> Mapping[str, int]:
    engine = CompiledEngine(wiring())
    try:
        return engine.registers
    finally:
        engine.close()


def _check(targets: Sequence[UpsetTarget], sizes: Mapping[str, int]) -> None:
    for target in targets:
        if target.name not in sizes:
            raise ValueError(f"there is no memory {target.name!r}; there are {', '.join(sizes)}")


def _moment(intervals: Sequence[Interval], phase: str, rng: np.random.Generator) -> int:
    there = [one for one in intervals if one.phase == phase]
    if not there:
        raise ValueError(f"a loop has no phase {phase}: {', '.join({i.phase for i in intervals})}")
    lengths = np.array([one.end_ps - one.start_ps for one in there], np.float64)
    chosen = there[int(rng.choice(len(there), p=lengths / lengths.sum()))]
    return int(rng.integers(chosen.start_ps, chosen.end_ps))


def _drawn(target: UpsetTarget, sizes: Mapping[str, int], rng: np.random.Generator) -> UpsetTarget:
    if not target.memory:
        return target
    return replace(target, bit=int(rng.integers(sizes[target.name])))
