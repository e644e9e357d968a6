"""A bar on a terminal: one display for a loop and those inside of it."""

from io import StringIO

import pytest
from rich.console import Console

from cubestack.host import terminal


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> StringIO:
    """What stands on a terminal that draws, whichever the tests run on."""
    monkeypatch.setenv("TERM", "xterm")
    file = StringIO()
    console = Console(file=file, force_terminal=True, width=100, color_system=None)
    monkeypatch.setattr(terminal, "_errors", console)
    return file


def test_items_pass_below_a_bar_that_is_gone_in_the_end(screen: StringIO) -> None:
    assert list(terminal.progress(range(3), 3, "measuring")) == [0, 1, 2]
    assert "measuring" in screen.getvalue()
    assert terminal._open == []


def test_a_loop_inside_has_a_line_of_the_same_display(screen: StringIO) -> None:
    found, displays = [], set()
    for outer in terminal.progress("ab", 2, "outside"):
        for inner in terminal.progress(range(2), 2, "inside"):
            found.append((outer, inner))
            (display,) = terminal._open
            displays.add(id(display))
            names = [task.description for task in display.tasks]
            assert names[:2] == ["outside", "inside"]
            assert [task.completed for task in display.tasks[:1]] == [ord(outer) - ord("a")]
    assert found == [("a", 0), ("a", 1), ("b", 0), ("b", 1)]
    assert len(displays) == 1
    assert terminal._open == []


def test_an_error_within_takes_the_display_down(screen: StringIO) -> None:
    def failing() -> None:
        for _ in terminal.progress(range(3), 3, "measuring"):
            raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        failing()
    assert list(terminal.progress(range(2), 2, "again")) == [0, 1]
    assert terminal._open == []


def test_quiet_work_has_no_bar(screen: StringIO) -> None:
    assert list(terminal.progress(range(3), 3, "measuring", quiet=True)) == [0, 1, 2]
    assert screen.getvalue() == ""
