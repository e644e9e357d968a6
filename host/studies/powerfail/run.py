"""Runs all cases of a scenario on the cores of this machine, or on a cluster."""

import gc
from collections.abc import Iterator
from dataclasses import dataclass

from cubestack.host.studies.powerfail.cases import Case
from cubestack.host.studies.powerfail.course import Course
from cubestack.host.studies.powerfail.rig import Rig, Setup
from cubestack.host.studies.powerfail.trial import Row, Tester
from cubestack.host.studies.workers import performed

BLOCK = 40
"""Most cases that a worker tries in sequence."""

BLOCKS = 4
"""Least number of blocks for each worker."""


@dataclass(frozen=True)
class Block:
    """Cases for one worker; the result depends on nothing else."""

    setup: Setup
    course: Course
    cases: tuple[Case, ...]


def run(
    setup: Setup, course: Course, cases: list[Case], workers: int, scheduler: str | None = None
) -> Iterator[list[Row]]:
    """Rows of each case, with those of its second cuts, as they are done."""
    size = max(1, min(BLOCK, len(cases) // (BLOCKS * workers)))
    blocks = [
        Block(setup, course, tuple(cases[first : first + size]))
        for first in range(0, len(cases), size)
    ]
    for _, groups in performed(try_block, blocks, workers, scheduler):
        yield from groups


def try_block(block: Block) -> list[list[Row]]:
    tester = Tester(block.setup, block.course, fresh_rig(block.setup))
    return list(tester.perform(block.cases))


_kept = list[tuple[Setup, Rig]]()


def fresh_rig(setup: Setup) -> Rig:
    """A device that was just powered up: it never runs, only copies of it do."""
    if not _kept or _kept[0][0] != setup:
        for _, rig in _kept:
            rig.close()
        _kept[:] = [(setup, Rig(setup))]
        gc.freeze()  # garbage collection would write to memory that the copies share
    return _kept[0][1]
