"""Standard input and exit status of a program that uses semihosting."""

import os
import pty
from collections.abc import Iterator

import pytest

from cubestack.host.cli.program import exit_status, read_console


class Stdin:
    def __init__(self, fileno: int) -> None:
        self._fileno = fileno

    def fileno(self) -> int:
        return self._fileno


@pytest.fixture(params=[os.pipe, pty.openpty], ids=["pipe", "terminal"])
def ends(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The end at which something is typed; the other one is standard input."""
    first, second = request.param()
    reading, writing = (first, second) if request.param is os.pipe else (second, first)
    monkeypatch.setattr("sys.stdin", Stdin(reading))
    yield writing
    os.close(first)
    os.close(second)


def test_input_is_read_up_to_the_wanted_count(ends: int) -> None:
    os.write(ends, b"hello\n")
    assert read_console(3) == b"hel"
    assert read_console(10) == b"lo\n"


def test_terminal_without_input_is_waited_for_and_a_pipe_has_ended(ends: int) -> None:
    assert read_console(3) == (None if os.isatty(ends) else b"")


def test_missing_standard_input_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", None)
    assert read_console(1) == b""


@pytest.mark.parametrize(
    ("status", "shown"), [(0, 0), (1, 1), (42, 42), (255, 255), (256, 1), (0xFFFF_FFFF, 255)]
)
def test_only_success_is_success(status: int, shown: int) -> None:
    assert exit_status(status) == shown
