"""Every argument of every command refuses wrong inputs in one line of plain words."""

from pathlib import Path

import pytest

from tests.conftest import Outcome
from tests.forked import forked

from .wrong_inputs import TEXTS, arguments, cases, problem, try_all


def tried(count: int, seed: int) -> Outcome:
    return forked(lambda: try_all(count, seed, accepted_s=1.5), timeout=900)


def test_cases_cover_every_argument(tmp_path: Path) -> None:
    kinds = {one.kind.rpartition(":")[0] for one in cases(tmp_path)}
    assert len(kinds) == len({(one.command, one.name) for one in arguments()}) > 400
    assert len(cases(tmp_path)) > len(kinds) * len(TEXTS)


@pytest.mark.parametrize(
    ("status", "said"),
    [
        (1, "Traceback (most recent call last):\n"),
        (2, "cubestack measure: 'utf-8' codec can't decode byte 0x89\n"),
        (1, "cubestack measure: one\nand more\n"),
        (99, "cubestack measure: x\n"),
        (2, "x: no such file\n"),
        (2, f"cubestack measure: {'x' * 2000}: no such file\n"),
    ],
)
def test_bad_ends_are_noticed(status: int, said: str) -> None:
    assert problem(status, said)


def test_a_few_wrong_inputs_are_refused_in_one_line() -> None:
    done = tried(12, 1)
    assert done.code == 0, done.out + done.err


@pytest.mark.slow
def test_wrong_inputs_are_refused_in_one_line() -> None:
    done = tried(200, 2)
    assert done.code == 0, done.out + done.err
