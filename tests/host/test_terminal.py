"""How far a long work is."""

from collections.abc import Iterator
from io import StringIO
from threading import Event

import pytest
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from cubestack.host import terminal


def test_off_a_terminal_lines_tell_how_far_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    lines, heard = list[str](), Event()

    def say(text: str) -> None:
        lines.append(text)
        heard.set()

    monkeypatch.setattr(terminal, "EVERY_S", 0.01)
    monkeypatch.setattr(terminal, "say", say)

    def slow() -> Iterator[int]:
        for number in range(3):
            assert heard.wait(10.0)  # one takes as long as it does
            heard.clear()
            yield number

    assert list(terminal.progress(slow(), 3, "measuring")) == [0, 1, 2]
    assert lines[0] == "measuring: 0 of 3"
    assert any(line.startswith("measuring: 2 of 3, ") for line in lines)
    assert all(line.endswith(" s left") for line in lines[1:] if "0 of 3" not in line)


def test_what_was_done_before_tells_nothing_about_the_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    lines, heard = list[str](), Event()
    monkeypatch.setattr(terminal, "EVERY_S", 0.01)
    monkeypatch.setattr(terminal, "say", lambda text: (lines.append(text), heard.set()))

    def items() -> Iterator[int]:
        yield from range(1000)
        assert heard.wait(10.0)

    assert len(list(terminal.progress(items(), 1001, "measuring", before=1000))) == 1000
    assert lines[-1] == "measuring: 1000 of 1001"


def test_quick_or_quiet_work_says_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    assert list(terminal.progress([1, 2], 2, "measuring")) == [1, 2]
    assert list(terminal.progress([1, 2], 2, "measuring", quiet=True)) == [1, 2]
    assert capfd.readouterr() == ("", "")


ROWS = [("0", "calculated, MaxStarsDetection"), ("12", "no\nstars [2]")]


def table() -> Table:
    shown = Table(title="a title that is longer than the table and the terminal are wide")
    shown.add_column("frame", justify="right")
    shown.add_column("status and flags", overflow="fold")
    for row in ROWS:
        shown.add_row(*(escape(cell) for cell in row))
    return shown


def printed(monkeypatch: pytest.MonkeyPatch, width: int, *, is_terminal: bool) -> list[str]:
    file = StringIO()
    console = Console(file=file, width=width, force_terminal=is_terminal, color_system=None)
    monkeypatch.setattr(terminal, "console", console)
    terminal.show(table())
    return file.getvalue().splitlines()


@pytest.mark.parametrize(("width", "is_terminal"), [(80, False), (20, False), (20, True)])
def test_a_table_is_plain_lines_in_a_pipe_and_where_it_is_too_wide(
    monkeypatch: pytest.MonkeyPatch, width: int, is_terminal: bool
) -> None:
    title, head, *rows = printed(monkeypatch, width, is_terminal=is_terminal)
    assert title == table().title
    assert head.split("  ")[-1].strip() == "status and flags"
    cells = [[cell.strip() for cell in row.split("  ", 1)] for row in map(str.strip, rows)]
    assert cells == [["0", "calculated, MaxStarsDetection"], ["12", "no  stars [2]"]]


def test_a_table_is_drawn_where_it_has_room(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = printed(monkeypatch, 80, is_terminal=True)
    assert any("┃" in line for line in lines)
    assert any("calculated, MaxStarsDetection" in line for line in lines)
