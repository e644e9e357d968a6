"""Which cases of a parametrised test are quick, which are slow, and which are today's."""

import os
from collections import Counter
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any
from zlib import crc32

import pytest

PARAM = type(pytest.param())

DAY = int(os.environ.setdefault("TESTS_DAY", str(datetime.now(UTC).toordinal())))
"""Number of the day since 1 January of the year 1; all processes of a run have the same."""


def quick(cases: Iterable[Any], count: int) -> list[Any]:
    """All cases; all but ``count`` evenly spread ones are marked slow.

    A tuple is a case of several values; wrap a value that is a tuple in ``pytest.param``.
    """
    found = list(cases)
    kept = {place * len(found) // count for place in range(count)}
    return [case if place in kept else _slow(case) for place, case in enumerate(found)]


def quick_ones(cases: Iterable[Any], *names: str) -> list[Any]:
    """All cases; all but the named ones are marked slow."""
    return [case if case in names else _slow(case) for case in cases]


def todays(turn: int, turns: int, cases: int) -> int:
    """Number of the case that a test runs as its ``turn`` of ``turns``, of 0 to ``cases`` - 1.

    The cases of a day are evenly spread. Each day has others, until every one has been run. There
    are at least as many cases as turns.
    """
    first, end = turn * cases // turns, (turn + 1) * cases // turns
    return first + DAY % (end - first)


def turns(item: pytest.Item, days: int) -> int:
    """Days in which a slow test has one turn, where others have one in ``days``; 0: all in each."""
    if days == 0 or item.get_closest_marker("daily"):
        return 1
    return max(days, 7) if item.get_closest_marker("weekly") else days


def of_day(names: Iterable[str], day: int, days: Iterable[int]) -> list[bool]:
    """Whether each test of ``names`` (its node's name) has its turn on the day numbered ``day``.

    Each has one turn in its number of ``days``; cases of one test have turns one after the other.
    """
    before = Counter[str]()
    found = list[bool]()
    for name, turns in zip(names, days, strict=True):
        test = name.partition("[")[0]
        found.append((crc32(test.encode()) + before[test] - day) % turns == 0)
        before[test] += 1
    return found


def _slow(case: Any) -> Any:
    if isinstance(case, PARAM):
        return pytest.param(*case.values, id=case.id, marks=[*case.marks, pytest.mark.slow])
    return pytest.param(*(case if isinstance(case, tuple) else [case]), marks=pytest.mark.slow)
