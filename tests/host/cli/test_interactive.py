import io
import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.host.cli import shell
from cubestack.host.errors import NoAnswerError
from cubestack.host.shell.names import CommandResult, ShellError
from tests.conftest import Run


class Asked:
    """A shell that answers without a device.

    Attributes:
        lines: that were executed.
        closed: whether its target is.
    """

    def __init__(self) -> None:
        self.lines = list[str]()
        self.closed = False
        self.interface = SimpleNamespace(name="CubeStar")
        self.target, self.name = self, "fake"
        self.outputs = SimpleNamespace(keep=lambda: None)
        self.on_row: Callable[[CommandResult], None] = lambda _result: None

    def __enter__(self) -> "Asked":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self.closed = True

    def execute(self, line: str) -> CommandResult | None:
        line = line.strip()
        self.lines.append(line)
        if line == "nothing":
            return None
        if line == "wrong":
            raise ShellError("no command 'wrong'")
        if line == "silent":
            raise NoAnswerError("no answer")
        if line == "rows":
            self.on_row(CommandResult([("row", "1")], {"row": 1}))
        return CommandResult([("a", "1"), ("longer", "2"), ("", "alone")], {"line": line})

    def complete(self, line: str) -> list[str]:
        return {"re": ["read", "reset"], "write A ": ["Gain=", "B"]}.get(line, [])


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Asked:
    one = Asked()
    monkeypatch.setattr(shell, "open_any_target", lambda *_of, **_how: one)
    monkeypatch.setattr(shell, "Shell", lambda _target: one)
    return one


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Any]:
    """Lines to type; an exception among them is raised instead."""
    lines = list[Any]()

    def ask(_prompt: str) -> str:
        line = lines.pop(0) if lines else EOFError()
        if isinstance(line, BaseException):
            raise line
        return str(line)

    monkeypatch.setattr("builtins.input", ask)
    monkeypatch.setattr(sys, "stdin", Terminal())
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return lines


SHOWN = "a       1\nlonger  2\nalone\n"


def test_prompt_repeats_after_errors_until_end_of_input(
    run: Run, asked: Asked, typed: list[Any]
) -> None:
    typed += ["one", "nothing", "wrong", "silent", KeyboardInterrupt(), "two"]
    code, out, err = run("shell", "fake")
    assert code == 0
    assert asked.lines == ["one", "nothing", "wrong", "silent", "two"]
    assert out == SHOWN + "\n" + SHOWN + "\n"  # a line of its own after ^C, and after ^D
    assert err.splitlines() == [
        "CubeStar at fake; Tab completes, help lists",
        "error: no command 'wrong'",
        "error: no answer",
    ]
    assert asked.closed


@pytest.mark.parametrize("word", ["quit", "exit", " quit "])
def test_quit_closes_the_device(run: Run, asked: Asked, typed: list[Any], word: str) -> None:
    typed += ["one", word, "two"]
    assert run("shell", "fake").code == 0
    assert (asked.lines, typed, asked.closed) == (["one"], ["two"], True)


def test_history_is_saved_and_tab_completes(
    run: Run, asked: Asked, typed: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    readline = pytest.importorskip("readline")
    completions = {"re": ["read ", "reset ", None], "write A ": ["Gain=", "B ", None], "x": [None]}

    def ask(_prompt: str) -> str:
        for line, words in completions.items():
            shown = line + " behind the cursor"
            monkeypatch.setattr(readline, "get_endidx", partial(len, line))
            monkeypatch.setattr(readline, "get_line_buffer", partial(str, shown))
            assert [readline.get_completer()("", n) for n in range(len(words))] == words
        readline.add_history("what was typed")
        return "quit"

    monkeypatch.setattr("builtins.input", ask)
    assert run("shell", "fake").code == 0
    history = tmp_path / "cubestack" / "history"
    assert "what was typed" in history.read_text("utf-8")
    readline.clear_history()
    monkeypatch.setattr("builtins.input", lambda _prompt: "quit")
    assert run("shell", "fake").code == 0
    assert readline.get_history_item(readline.get_current_history_length()) == "what was typed"


def test_shell_prompts_without_readline(
    run: Run, asked: Asked, typed: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "readline", None)
    typed += ["one"]
    assert run("shell", "fake").code == 0
    assert asked.lines == ["one"]


def test_reads_commands_from_a_pipe(
    run: Run, asked: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("one\nnothing\n  exit \ntwo\n"))
    assert run("shell", "fake") == (0, SHOWN, "")
    assert asked.lines == ["one", "nothing"]
    assert asked.closed


def test_json_prints_one_object_per_command(run: Run, asked: Asked) -> None:
    code, out, _ = run("shell", "fake", "--json", "-c", "rows; nothing", "-c", "two")
    assert code == 0
    assert [json.loads(line)["line"] for line in out.splitlines()] == ["rows", "two"]
    shown = run("shell", "fake", "-c", "rows").out
    assert shown == "row  1\n" + SHOWN


@pytest.mark.parametrize("options", [["-c", "one;wrong;two"], ["-c", "one", "-c", "wrong;two"]])
def test_script_stops_at_the_first_failure_and_closes_the_device(
    run: Run, asked: Asked, options: list[str]
) -> None:
    assert run("shell", "fake", *options).code == 2
    assert (asked.lines, asked.closed) == (["one", "wrong"], True)
    assert run("shell", "fake", "-c", "silent").code == 1


@pytest.mark.parametrize(
    ("text", "commands"),
    [
        ("a;b", ["a", "b"]),
        ("a\nb;", ["a", "b", ""]),
        ("say 'x;y';b", ["say 'x;y'", "b"]),
        ('say "it\'s;" ; b', ['say "it\'s;" ', " b"]),
        ("'a\nb'", ["'a\nb'"]),
        ("", [""]),
    ],
)
def test_semicolons_and_newlines_separate_commands_outside_quotes(
    text: str, commands: list[str]
) -> None:
    assert list(shell.split_commands(text)) == commands
