from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.sim.virtual_time import PS_PER_US, Kernel
from cubestack.host.devices.registry import device
from cubestack.host.experiments.measure import experiment_of
from cubestack.host.studies.upsets.atlas import HEAD, atlas, lines, rows
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
from cubestack.host.studies.upsets.subject import Answer, PortWatch, Subject, UpsetVerdict

ROW = 16
CLEAN = Snapshot(
    np.arange(8 * ROW, dtype=np.uint8),
    [(1000, "ACK", 1), (2000, "ACK", 0)],
    bytes(8),
    {"SRAM": np.zeros(8 * ROW, np.uint8)},
    {"read-access": 1},
)


RIGHT = UpsetResult(
    *("writer$3.row", 0, False, "storing", 1.0, "nothing", "right", "", 0),
    *({"idle": 0.75, "storing": 0.25}, 1.0, 9, 2.0),
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
def test_upset_effect_is_the_most_severe_one(found: Snapshot, effect: Effect) -> None:
    assert effect_of(found, CLEAN, ROW) == effect


@pytest.mark.parametrize(
    ("answer", "right", "solved"),
    [("right", True, True), ("wrong", False, True), ("refused", False, False)],
)
def test_wrong_answer_counts_as_solved_and_refusal_does_not(
    answer: Answer, right: bool, solved: bool
) -> None:
    one = replace(RIGHT, answer=answer)
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
def test_upset_recovery_counts_iterations_until_a_right_answer(
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


class Port:
    """An FPGA port whose levels and time are set by the test."""

    running = 2

    def __init__(self) -> None:
        self.now_ps = 100
        self.levels = {"ACK": 0, "DONE": 0, "other": 0}
        self.told = list[Any]()

    def get_pin(self, name: str) -> int:
        return self.levels[name]

    def set_pin(self, name: str, value: int) -> None:
        self.told.append((name, value))

    def run(self, until_ps: int, stop_on: tuple[str, int] | None) -> int:
        self.told.append((until_ps, stop_on))
        return until_ps - 1

    def attend(self, *of: int) -> int:
        self.told.append(of)
        return 7

    def strobe_read(self, out: Any, period: Fraction, until_ps: int) -> int:
        out[:3] = (1, 2, 3)
        return 3

    def access(self, transactions: Any, until_ps: int) -> int:
        return 2


def test_port_watch_records_acknowledge_changes_only() -> None:
    port: Any = Port()
    watch = PortWatch(port, ("ACK", "DONE"))
    for now_ps, name, level in (
        *((100, "ACK", 0), (200, "ACK", 1), (300, "ACK", 1), (350, "other", 1)),
        *((400, "DONE", 1), (500, "ACK", 0), (600, "DONE", 1)),
    ):
        port.now_ps, port.levels[name] = now_ps, level
        assert watch.get_pin(name) == level
    assert watch.seen == [(200, "ACK", 1), (400, "DONE", 1), (500, "ACK", 0)]
    watch.clear()
    assert (watch.seen, watch.data) == ([], bytearray())
    assert watch.get_pin("DONE") == 1
    assert watch.seen == []  # it is as it was


def test_received_bytes_are_kept() -> None:
    watch = PortWatch(Port(), ())  # type: ignore[arg-type]
    out = np.full(5, 9, np.uint8)
    assert watch.strobe_read(out, Fraction(1), 10) == 3
    data = np.array([4, 5, 6], np.uint8)
    read: Any = SimpleNamespace(write=False, data=data)
    written: Any = SimpleNamespace(write=True, data=data)
    assert watch.access(written, 10) == watch.access(read, 10) == 2
    assert bytes(watch.data) == bytes([1, 2, 3, 4, 5])


def test_port_watch_passes_other_calls_on() -> None:
    port: Any = Port()
    watch = PortWatch(port, ("ACK",))
    watch.set_pin("READ", 1)
    assert watch.run(50, ("ACK", 1)) == 49
    assert watch.attend(1, 2, 3, 4) == 7
    assert port.told == [("READ", 1), (50, ("ACK", 1)), (1, 2, 3, 4)]
    assert (watch.now_ps, watch.running, watch.driver) == (100, 2, None)


PICTURE = replace(RIGHT, effect="picture", bit=1)
WRONG = replace(PICTURE, answer="wrong", recovered=1)
IDLE = replace(RIGHT, phase="idle")


def test_atlas_merges_numbered_names_and_counts_effects() -> None:
    (part,) = atlas([RIGHT, PICTURE, WRONG, IDLE])
    assert part.name == "writer.row"
    assert (part.effects["picture"], part.effects["nothing"], part.answers["wrong"]) == (2, 2, 1)
    assert (part.seen, part.healed) == (2, (1, 1))


def test_rate_weights_phases_by_duration() -> None:
    (part,) = atlas([RIGHT, PICTURE, WRONG, IDLE])
    # Of what is stored in a quarter of the second two upsets of three are seen, of 9 bits.
    assert part.a_day == pytest.approx(2.0 * 9 * 0.25 * 2 / 3)
    (idle,) = atlas([replace(PICTURE, phase="idle")])
    assert idle.a_day == pytest.approx(2.0 * 9 * 0.75)


def test_left_over_state_counts_as_seen_only_with_a_bad_answer() -> None:
    left = replace(RIGHT, effect="left over")
    assert atlas([left])[0].seen == 0
    assert atlas([replace(left, answer="refused")])[0].seen == 1


def test_table_has_all_parts_and_their_sum() -> None:
    results = [RIGHT, WRONG, replace(WRONG, target="bank", bits=1)]
    table = list(rows(atlas(results)))
    assert [len(row) for row in table] == [len(HEAD)] * 3
    assert [row[0] for row in table] == ["bank", "writer.row", "all"]
    assert float(table[-1][-1]) == pytest.approx(sum(float(row[-1]) for row in table[:-1]), rel=0.1)
    assert any("writer.row" in line and "1 picture" in line for line in lines(results))


def test_report_has_table_and_figure() -> None:
    tested = experiment_of(device("cubestar"), "upsets")
    table, figure = tested.sections(map(vars, [RIGHT, WRONG]))
    assert list(table.head) == list(HEAD)
    assert figure.png.startswith(b"\x89PNG")
