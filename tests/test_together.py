import re
from typing import Any

import pytest

from tests.together import together


@pytest.fixture
def limit() -> int:
    return 3


def test_failure_names_all_failing_cases_and_shows_the_first() -> None:
    seen = list[int]()

    @together("number", range(6))
    def test_small(number: int, limit: int) -> None:
        seen.append(number)
        assert number < limit, number

    with pytest.raises(AssertionError, match=r"^3\n") as raised:
        test_small(limit=3)
    assert seen == [*range(6)]
    assert raised.value.__notes__ == ["3 of 6 cases fail: number=3; number=4; number=5"]


@pytest.mark.parametrize("factor", [1, 2])
@together(("a", "b"), [(1, 2), pytest.param(2, 1, id="swapped")])
@together("c", [0, 1])
def test_fixtures_and_other_cases_are_given(
    a: int, b: int, c: int, factor: int, limit: int
) -> None:
    assert a + b == limit
    assert c < 2
    assert factor in (1, 2)


def test_missing_exception_is_a_failure_of_its_case() -> None:
    @together("text", ["1", "x"])
    def test_refused(text: str) -> None:
        with pytest.raises(ValueError, match="invalid"):
            int(text)

    with pytest.raises(pytest.fail.Exception) as raised:
        test_refused()
    assert raised.value.__notes__ == ["1 of 2 cases fail: text='1'"]


def test_label_is_the_id() -> None:
    @together("a, b", [pytest.param(1, 1, id="same"), (1, 2)], ids=None)
    def test_differ(a: int, b: int) -> None:
        assert a != b

    with pytest.raises(AssertionError) as raised:
        test_differ()
    assert raised.value.__notes__ == ["1 of 2 cases fail: same"]


@pytest.mark.parametrize(("ids", "label"), [(["odd"], "odd"), (hex, "number=0x11")])
def test_label_may_be_given(ids: Any, label: str) -> None:
    @together("number", [17], ids=ids)
    def test_even(number: int) -> None:
        assert number % 2 == 0

    with pytest.raises(AssertionError) as raised:
        test_even()
    assert raised.value.__notes__ == [f"1 of 1 cases fail: {label}"]


@pytest.mark.parametrize("cases", [[], [pytest.param(1, marks=pytest.mark.slow)]])
def test_rejects_marked_cases_and_none(cases: list[object]) -> None:
    with pytest.raises(TypeError, match=re.escape("number: expected cases without marks")):
        together("number", cases)
