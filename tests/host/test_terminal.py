from collections.abc import Iterator
from io import StringIO
from threading import Event

import pytest
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from cubestack.host import terminal

TERMINAL = {"TERM": "xterm"}


class Lines(list[str]):
    """Progress lines; ``heard`` is set by each one."""

    def __init__(self) -> None:
        super().__init__()
        self.heard = Event()

    def say(self, text: str) -> None:
        self.append(text)
        self.heard.set()


@pytest.fixture
def lines(monkeypatch: pytest.MonkeyPatch) -> Lines:
    made = Lines()
    monkeypatch.setattr(terminal, "EVERY_S", 0.01)
    monkeypatch.setattr(terminal, "say", made.say)
    return made


def replace_console(
    monkeypatch: pytest.MonkeyPatch, width: int, *, is_terminal: bool, name: str = "console"
) -> StringIO:
    file = StringIO()
    console = Console(
        file=file, width=width, force_terminal=is_terminal, color_system=None, _environ=TERMINAL
    )
    monkeypatch.setattr(terminal, name, console)
    return file


def test_progress_prints_plain_lines_when_not_a_tty(lines: Lines) -> None:
    def slow() -> Iterator[int]:
        for number in range(3):
            assert lines.heard.wait(10.0)
            lines.heard.clear()
            yield number

    assert list(terminal.progress(slow(), 3, "measuring")) == [0, 1, 2]
    assert lines[0] == "measuring: 0 of 3, 0 s"
    assert any(line.startswith("measuring: 2 of 3, ") for line in lines)
    assert all(line.endswith(" s left") for line in lines[1:] if "0 of 3" not in line)


def test_progress_rate_ignores_steps_done_before(lines: Lines) -> None:
    def items() -> Iterator[int]:
        yield from range(1000)
        assert lines.heard.wait(10.0)

    assert len(list(terminal.progress(items(), 1001, "measuring", before=1000))) == 1000
    assert lines[-1] == "measuring: 1000 of 1001, 0 s"


def test_busy_prints_the_elapsed_time(lines: Lines) -> None:
    with terminal.busy("starting CubeStar"):
        assert lines.heard.wait(10.0)
    assert set(lines) == {"starting CubeStar: 0 s"}


def test_only_the_innermost_work_is_reported(lines: Lines) -> None:
    with terminal.busy("starting AraMiS"):
        with terminal.busy("scanning the sky") as shown:
            shown(3, 10)
            for _ in range(3):
                lines.heard.clear()
                assert lines.heard.wait(10.0)
            inside = lines[-2:]
        lines.heard.clear()
        assert lines.heard.wait(10.0)
    assert all(line.startswith("scanning the sky: 3 of 10, ") for line in inside)
    assert lines[-1].startswith("starting AraMiS: ")


@pytest.mark.parametrize("is_terminal", [False, True])
def test_long_result_lines_are_not_wrapped(
    monkeypatch: pytest.MonkeyPatch, is_terminal: bool
) -> None:
    long = "[no markup] " + "many words " * 20
    file = replace_console(monkeypatch, 30, is_terminal=is_terminal)
    terminal.tell(long)
    terminal.head(long)
    assert file.getvalue().splitlines() == [long, f"== {long} =="]


@pytest.mark.parametrize("title", ["a title", "as long as a row of thirty"])
def test_terminal_title_has_a_rule_if_it_fits(monkeypatch: pytest.MonkeyPatch, title: str) -> None:
    file = replace_console(monkeypatch, 30, is_terminal=True)
    terminal.head(title)
    assert f"─ {title} ─" in file.getvalue()


def test_quick_or_quiet_work_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
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
    file = replace_console(monkeypatch, width, is_terminal=is_terminal)
    terminal.show(table())
    return file.getvalue().splitlines()


@pytest.mark.parametrize(("width", "is_terminal"), [(80, False), (20, False), (20, True)])
def test_table_is_plain_in_a_pipe_or_a_narrow_terminal(
    monkeypatch: pytest.MonkeyPatch, width: int, is_terminal: bool
) -> None:
    title, head, *rows = printed(monkeypatch, width, is_terminal=is_terminal)
    assert title == table().title
    assert head.split("  ")[-1].strip() == "status and flags"
    cells = [[cell.strip() for cell in row.split("  ", 1)] for row in map(str.strip, rows)]
    assert cells == [["0", "calculated, MaxStarsDetection"], ["12", "no  stars [2]"]]


def test_table_is_drawn_if_it_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = printed(monkeypatch, 80, is_terminal=True)
    assert any("┃" in line for line in lines)
    assert any("calculated, MaxStarsDetection" in line for line in lines)


@pytest.mark.parametrize("is_terminal", [False, True])
def test_results_are_printed_above_the_bar_or_to_their_file(
    monkeypatch: pytest.MonkeyPatch, is_terminal: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    results = replace_console(monkeypatch, 30, is_terminal=is_terminal)
    errors = replace_console(monkeypatch, 30, is_terminal=True, name="_errors")
    long = "a result that is longer than the terminal is wide"
    for _ in terminal.progress(range(2), 2, "proofs"):
        terminal.tell(long)
        print("printed")
    assert "proofs" in errors.getvalue()
    assert results.getvalue().splitlines() == ([] if is_terminal else [long, long])
    assert errors.getvalue().count(long) == (2 if is_terminal else 0)
    assert capsys.readouterr().out == "printed\nprinted\n"


def test_dumb_terminal_gets_plain_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    file = StringIO()
    dumb = Console(file=file, force_terminal=True, _environ={"TERM": "dumb"})
    monkeypatch.setattr(terminal, "_errors", dumb)
    monkeypatch.setattr(terminal, "EVERY_S", 0.01)
    heard, say = Event(), terminal.say
    monkeypatch.setattr(terminal, "say", lambda text: (say(text), heard.set()))
    with terminal.busy("starting"):
        assert heard.wait(10.0)
    assert file.getvalue().startswith("starting: 0 s")


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> StringIO:
    monkeypatch.setenv("TERM", "xterm")
    return replace_console(monkeypatch, 100, is_terminal=True, name="_errors")


def test_nested_loops_share_one_display(screen: StringIO) -> None:
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
    assert "outside" in screen.getvalue()
    assert terminal._open == []


def test_error_removes_the_display(screen: StringIO) -> None:
    def failing() -> None:
        for _ in terminal.progress(range(3), 3, "measuring"):
            raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        failing()
    assert list(terminal.progress(range(2), 2, "again")) == [0, 1]
    assert terminal._open == []


def test_quiet_progress_has_no_bar(screen: StringIO) -> None:
    assert list(terminal.progress(range(3), 3, "measuring", quiet=True)) == [0, 1, 2]
    assert screen.getvalue() == ""


@pytest.mark.parametrize("terminal_or_pipe", [True, False])
def test_escape_sequences_are_shown(
    terminal_or_pipe: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = StringIO()
    console = Console(file=out, force_terminal=terminal_or_pipe, no_color=True, width=200)
    monkeypatch.setattr(terminal, "console", console)
    monkeypatch.setattr(terminal, "_errors", console)
    table = Table("a\x1b]0;x\x07", title="t\x1b[2J")
    table.add_row("b\x1b[31m")
    for show in (terminal.say, terminal.tell, terminal.head):
        show("c\x1b[31m\r\x9b")
    terminal.show(table)
    for sequence in ("\x1b]", "\x1b[31m", "\x1b[2J", "\x07", "\r\x9b"):
        assert sequence not in out.getvalue()
    assert r"c\x1b[31m\r\x9b" in out.getvalue()
    assert r"b\x1b[31m" in out.getvalue()
