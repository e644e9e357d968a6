"""Which cases of a parametrized test run each time, and which only with all tests."""

from collections.abc import Iterable
from typing import Any

import pytest

PARAM = type(pytest.param())


def quick(cases: Iterable[Any], count: int) -> list[Any]:
    """All cases; ``count`` of them, evenly spread, run each time, and the others are slow.

    A tuple is a case of several values; a value that is a tuple is to be a ``pytest.param``.
    """
    found = list(cases)
    kept = {place * len(found) // count for place in range(count)}
    return [case if place in kept else _slow(case) for place, case in enumerate(found)]


def quick_ones(cases: Iterable[Any], *names: str) -> list[Any]:
    """All cases; those of these names run each time, and the others are slow."""
    return [case if case in names else _slow(case) for case in cases]


def _slow(case: Any) -> Any:
    if isinstance(case, PARAM):
        return pytest.param(*case.values, id=case.id, marks=[*case.marks, pytest.mark.slow])
    return pytest.param(*(case if isinstance(case, tuple) else [case]), marks=pytest.mark.slow)
