"""A copy of this process tells what it did, or how it failed; here nothing changes."""

import os
import time

import pytest

from cubestack.host.studies.upsets.fork import CopyError, in_copy


def test_it_gives_what_came_and_changes_nothing_here() -> None:
    here = [1]

    def act() -> tuple[int, list[int]]:
        here.append(2)
        return os.getpid(), here

    process, there = in_copy(act)
    assert process != os.getpid()
    assert (there, here) == ([1, 2], [1])


def test_much_comes_whole() -> None:
    assert in_copy(lambda: bytes(3_000_000)) == bytes(3_000_000)


def test_an_error_is_told() -> None:
    with pytest.raises(CopyError, match="ZeroDivisionError: "):
        in_copy(lambda: 1 // 0)


def test_a_death_is_told() -> None:
    with pytest.raises(CopyError, match="died"):
        in_copy(lambda: os._exit(3))


def test_one_that_hangs_is_ended() -> None:
    with pytest.raises(CopyError, match=r"no end after 0.1 s"):
        in_copy(lambda: time.sleep(600), limit_s=0.1)
