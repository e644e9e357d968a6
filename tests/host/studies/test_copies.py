import os
import time
from collections.abc import Callable

import pytest

from cubestack.host.studies.copies import CopyError, in_copy


def test_copy_returns_its_result_and_leaves_this_process_unchanged() -> None:
    here = [1]

    def act() -> tuple[int, list[int]]:
        here.append(2)
        return os.getpid(), here

    process, there = in_copy(act)
    assert process != os.getpid()
    assert (there, here) == ([1, 2], [1])


def test_large_results_are_returned() -> None:
    assert in_copy(lambda: bytes(3_000_000)) == bytes(3_000_000)


@pytest.mark.parametrize(
    ("act", "message"), [(lambda: 1 // 0, "ZeroDivisionError: "), (lambda: os._exit(3), "died")]
)
def test_error_or_death_of_a_forked_copy_raises_copy_error(
    act: Callable[[], int], message: str
) -> None:
    with pytest.raises(CopyError, match=message):
        in_copy(act)


def test_hanging_copy_times_out() -> None:
    with pytest.raises(CopyError, match=r"no end after 0.1 s"):
        in_copy(lambda: time.sleep(600), limit_s=0.1)
