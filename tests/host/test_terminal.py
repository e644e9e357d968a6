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
    assert lines[0] == "measuring: 0 of 3, 0 s"
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
    assert lines[-1] == "measuring: 1000 of 1001, 0 s"


def test_what_has_no_steps_tells_how_long_it_has_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    lines, heard = list[str](), Event()
    monkeypatch.setattr(terminal, "EVERY_S", 0.01)
    monkeypatch.setattr(terminal, "say", lambda text: (lines.append(text), heard.set()))
    with terminal.busy("starting CubeStar"):
        assert heard.wait(10.0)
    assert set(lines) == {"starting CubeStar: 0 s"}


def test_only_the_innermost_tells(monkeypatch: pytest.MonkeyPatch) -> None:
    lines, heard = list[str](), Event()
    monkeypatch.setattr(terminal, "EVERY_S", 0.01)
    monkeypatch.setattr(terminal, "say", lambda text: (lines.append(text), heard.set()))
    with terminal.busy("starting AraMiS"):
        with terminal.busy("scanning the sky") as shown:
            shown(3, 10)
            for _ in range(3):
                heard.clear()
                assert heard.wait(10.0)
            inside = lines[-2:]
        heard.clear()
        assert heard.wait(10.0)
    assert all(line.startswith("scanning the sky: 3 of 10, ") for line in inside)
    assert lines[-1].startswith("starting AraMiS: ")


@pytest.mark.parametrize("is_terminal", [False, True])
def test_a_long_line_of_a_result_is_not_broken(
    monkeypatch: pytest.MonkeyPatch, is_terminal: bool
) -> None:
    file, long = StringIO(), "[no markup] " + "many words " * 20
    console = Console(
        file=file, width=30, force_terminal=is_terminal, color_system=None, _environ=TERMINAL
    )
    monkeypatch.setattr(terminal, "console", console)
    terminal.tell(long)
    terminal.head(long)
    assert file.getvalue().splitlines() == [long, f"== {long} =="]


@pytest.mark.parametrize("title", ["a title", "as long as a row of thirty"])
def test_a_title_is_ruled_where_it_has_room(monkeypatch: pytest.MonkeyPatch, title: str) -> None:
    file = StringIO()
    console = Console(
        file=file, width=30, force_terminal=True, color_system=None, _environ=TERMINAL
    )
    monkeypatch.setattr(terminal, "console", console)
    terminal.head(title)
    assert f"─ {title} ─" in file.getvalue()


def test_quick_or_quiet_work_says_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    assert list(terminal.progress([1, 2], 2, "measuring")) == [1, 2]
    assert list(terminal.progress([1, 2], 2, "measuring", quiet=True)) == [1, 2]
    assert capfd.readouterr() == ("", "")


TERMINAL = {"TERM": "xterm"}

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
    console = Console(
        file=file, width=width, force_terminal=is_terminal, color_system=None, _environ=TERMINAL
    )
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


@pytest.mark.parametrize("is_terminal", [False, True])
def test_results_come_above_the_bar_or_go_to_their_file(
    monkeypatch: pytest.MonkeyPatch, is_terminal: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    results, errors = StringIO(), StringIO()
    for name, file, drawn in (("console", results, is_terminal), ("_errors", errors, True)):
        console = Console(
            file=file, width=30, force_terminal=drawn, color_system=None, _environ=TERMINAL
        )
        monkeypatch.setattr(terminal, name, console)
    long = "a result that is longer than the terminal is wide"
    for _ in terminal.progress(range(2), 2, "proofs"):
        terminal.tell(long)
        print("printed")
    assert "proofs" in errors.getvalue()
    assert results.getvalue().splitlines() == ([] if is_terminal else [long, long])
    assert errors.getvalue().count(long) == (2 if is_terminal else 0)
    assert capsys.readouterr().out == "printed\nprinted\n"


def test_where_nothing_can_be_drawn_lines_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    file = StringIO()
    dumb = Console(file=file, force_terminal=True, _environ={"TERM": "dumb"})
    monkeypatch.setattr(terminal, "_errors", dumb)
    monkeypatch.setattr(terminal, "EVERY_S", 0.01)
    heard, say = Event(), terminal.say
    monkeypatch.setattr(terminal, "say", lambda text: (say(text), heard.set()))
    with terminal.busy("starting"):
        assert heard.wait(10.0)
    assert file.getvalue().startswith("starting: 0 s")
