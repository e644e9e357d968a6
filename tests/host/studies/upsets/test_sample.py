from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.sim.virtual_time import PS_PER_US, Kernel
from cubestack.host.studies.upsets.clean import CleanLoop, Interval, Snapshot, take
from cubestack.host.studies.upsets.sample import (
    Effect,
    Outcome,
    Running,
    Upset,
    UpsetResult,
    UpsetTarget,
    effect_of,
    followed,
)
from cubestack.host.studies.upsets.subject import Answer, Subject, UpsetVerdict
from cubestack.host.studies.upsets.watch import PortWatch

ROW = 16
CLEAN = Snapshot(
    np.arange(8 * ROW, dtype=np.uint8),
    [(1000, "ACK", 1), (2000, "ACK", 0)],
    bytes(8),
    {"SRAM": np.zeros(8 * ROW, np.uint8)},
    {"read-access": 1},
)


def changed(*places: int) -> Snapshot:
    data = CLEAN.data.copy()
    data[list(places)] ^= 1
    return replace(CLEAN, data=data)


@pytest.mark.parametrize(
    ("found", "effect"),
    [
        (CLEAN, "nothing"),
        (replace(CLEAN, registers=b"\1" + bytes(7)), "left over"),
        (replace(CLEAN, memories={"SRAM": np.ones(8 * ROW, np.uint8)}), "left over"),
        (changed(5), "pixel"),
        (changed(5, 6), "pixel"),
        (changed(5, 6, 7), "row"),
        (changed(2, 3, 2 + ROW - 1), "row"),
        (changed(2, 3, 2 + ROW), "picture"),
        (replace(CLEAN, data=CLEAN.data[:-1]), "picture"),
        (replace(CLEAN, seen=[(1001, "ACK", 1), (2000, "ACK", 0)]), "late"),
        (replace(changed(5), seen=[]), "no ACK"),
        (replace(changed(5), violations={"read-access": 2}), "timing"),
        (replace(CLEAN, violations={"read-access": 1, "wire-contention": 1}), "contention"),
    ],
)
def test_effect_is_the_most_severe(found: Snapshot, effect: Effect) -> None:
    assert effect_of(found, CLEAN, ROW) == effect


@pytest.mark.parametrize(
    ("answer", "right", "solved"),
    [("right", True, True), ("wrong", False, True), ("refused", False, False)],
)
def test_wrong_answer_is_solved_and_refusal_is_not(
    answer: Answer, right: bool, solved: bool
) -> None:
    one = UpsetResult(
        *("row", 0, False, "idle", 1.0, "nothing", answer, "", 0), *({"idle": 1.0}, 1.0, 9, 2.0)
    )
    assert (one.right, one.solved) == (right, solved)


class Device:
    """A device with a loop from 10 to 50 us and given answers."""

    def __init__(self, answers: Sequence[Answer]) -> None:
        self.kernel, self.answers = Kernel(10 * PS_PER_US), iter(answers)
        self.ram = np.zeros(4, np.uint8)
        self.log: list[tuple[str, int]] = []

    def inject(self, _kind: str, *, target: str, address: int, bit: int) -> None:
        self.ram[address] ^= 1 << bit
        self._note(f"{target} is hit")

    def start(self, _emulated: Any) -> None:
        self._note("start")

    def judge(self, _emulated: Any) -> UpsetVerdict:
        self._note("judge")
        return UpsetVerdict(next(self.answers))

    def running(self) -> Running:
        """In the middle of a correct loop."""
        engine = SimpleNamespace(
            now_ps=0, run=lambda _until: 0, state=bytes, memories={}, violation_counts={}
        )
        sites: Any = SimpleNamespace(
            kernel=self.kernel, engine=engine, all_memories=lambda: {"ram": self.ram}
        )
        emulated: Any = SimpleNamespace(board=SimpleNamespace(kernel=self.kernel), faults=self)
        port: Any = None
        watch = PortWatch(port, ())
        snapshot = replace(take(sites, watch), memories={"ram": self.ram.copy()})
        loop = [Interval("storing", 10 * PS_PER_US, 50 * PS_PER_US)]
        clean = CleanLoop(loop, 40 * PS_PER_US, snapshot, UpsetVerdict("right"))
        subject = Subject(lambda _generator: None, self.start, self.judge, lambda _engine: "", ROW)
        return Running(emulated, subject, sites, watch, clean)

    def _note(self, what: str) -> None:
        self.log.append((what, self.kernel.now // PS_PER_US))


@pytest.mark.parametrize(
    ("answers", "recovered"),
    [
        (["right"], 0),
        (["wrong", "right"], 1),
        (["wrong", "refused", "right"], 2),
        (["refused", "wrong", "wrong", "right"], 3),
        (["refused", "wrong", "wrong", "wrong"], None),
    ],
)
def test_loops_run_until_an_answer_is_right(
    answers: Sequence[Answer], recovered: int | None
) -> None:
    device = Device(answers)
    upset = Upset(20 * PS_PER_US, "storing", UpsetTarget("ram", 13, memory=True))
    found = followed(device.running(), [upset, upset])
    assert found == [Outcome("left over", UpsetVerdict(answers[0]), recovered)]
    assert device.ram.tolist() == [0, 1 << 5, 0, 0]
    further = [
        (what, us)
        for begin_us in range(50, 10 + 40 * len(answers), 40)
        for what, us in (("start", begin_us), ("judge", begin_us + 40))
    ]
    assert device.log == [("ram is hit", 20), ("judge", 50), *further]
