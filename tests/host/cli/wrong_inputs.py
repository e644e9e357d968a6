"""Wrong inputs for every argument of every command, derived from the declared arguments.

``python -m tests.host.cli.wrong_inputs COUNT SEED`` tries COUNT of them, 0 for all, each in a
forked process, and prints those that do not end as they should: with exit status 1 or 2 and one
line of plain words on standard error. A call that is still running after `ACCEPTED_S` was not
wrong, and must end by Ctrl-C.
"""

import argparse
import io
import os
import random
import re
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from cubestack.host.cli.main import main, make_parser
from cubestack.host.cli.start import deliver_again

DIGITS = "9" * 400
DEPTH = 20_000

TEXTS = {
    "empty": "",
    "space": " ",
    "letters": "wrong",
    "unit": "5 parsecs",
    "nan": "nan",
    "infinite": "-inf",
    "huge": "1e999",
    "digits": DIGITS,
    "list": "1,2,3,4,5,6,7,8,9",
    "nested": "[" * 200,
    "equals": "=",
    "colon": "::::",
    "letter": "\N{SNOWMAN}",
    "surrogate": "\udcff",
    "line": "a\nb",
    "long": "k" * 50_000,
}

GIVEN = {
    "TARGET": "emulated:cubestar",
    "targets": "emulated:cubestar",
    "PROGRAM": "true",
    "NAME": "glow",
    "NAME|FILE": "cubestar",
    "TOP": "cubestar",
    "DEVICE": "cubestar",
    "PORT[@BAUD]": "/dev/null",
}
"""A right value of each positional argument that has no choices, by its metavar; else a file."""


def _sparse(path: Path) -> None:
    with path.open("wb") as stream:
        stream.truncate(1 << 33)


FILES: dict[str, Callable[[Path], object]] = {
    "missing": lambda path: None,
    "folder": lambda path: path.mkdir(),
    "nothing": lambda path: path.touch(),
    "binary": lambda path: path.write_bytes(random.Random(1).randbytes(5000)),
    "picture": lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100)),
    "source": lambda path: path.write_text("int main(void) { return 0; }\n"),
    "numbers": lambda path: path.write_text(f"seed = {DIGITS}\nx = nan\n"),
    "brackets": lambda path: path.write_text("x = " + "[" * DEPTH),
    "json": lambda path: path.write_text('{"a":' * DEPTH),
    "large": _sparse,
    "unreadable": lambda path: path.symlink_to("/proc/self/mem"),
    "pipe": lambda path: os.mkfifo(path),
    "loop": lambda path: path.symlink_to(path.name),
}
"""Kinds of wrong files, and how each is made."""

FILE_WORDS = ("FILE", "DIR", "FOLDER", "PATH", "PLAN", "IMAGE", "SCENE")


class Argument(NamedTuple):
    command: tuple[str, ...]
    parser: argparse.ArgumentParser
    action: argparse.Action

    @property
    def name(self) -> str:
        return self.action.option_strings[0] if self.action.option_strings else self.action.dest

    @property
    def is_file(self) -> bool:
        words = str(self.action.metavar)
        return self.action.type is Path or any(word in words for word in FILE_WORDS)


class Case(NamedTuple):
    """A call with one wrong input; ``kind`` names what is wrong."""

    kind: str
    words: tuple[str, ...]


_parser = cache(make_parser)


def arguments() -> Iterator[Argument]:
    """All arguments that take a value, of all commands and their actions."""
    return (one for one in all_arguments() if one.action.nargs != 0)


def all_arguments() -> Iterator[Argument]:
    """The same, and flags."""
    yield from _arguments((), _parser())


def _arguments(command: tuple[str, ...], parser: argparse.ArgumentParser) -> Iterator[Argument]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, inner in action.choices.items():
                yield from _arguments((*command, name), inner)
        else:
            yield Argument(command, parser, action)


def _positional(action: argparse.Action, files: Path) -> str:
    if action.choices:
        return str(next(iter(action.choices)))
    return GIVEN.get(str(action.metavar or action.dest), str(files / "nothing"))


def case(argument: Argument, kind: str, files: Path) -> Case:
    """The shortest call of a command in which this argument has a wrong value."""
    value = TEXTS[kind] if kind in TEXTS else str(files / kind)
    words = list(argument.command)
    if argument.action.option_strings:
        long = argument.name.startswith("--")
        words.append(f"{argument.name}={value}" if long else argument.name + value)
    for action in argument.parser._actions:
        if action is argument.action:
            if not action.option_strings:
                words.append(value)
        elif not action.option_strings and action.nargs not in ("?", 0):
            words.append(_positional(action, files))
        elif action.required:
            words += [action.option_strings[0], _positional(action, files)]
    return Case(f"{' '.join(argument.command)} {argument.name}: {kind}", tuple(words))


def cases(files: Path) -> list[Case]:
    """All calls; ``files`` is the folder that `make_files` filled."""
    return [
        case(argument, kind, files)
        for argument in arguments()
        for kind in (*TEXTS, *(FILES if argument.is_file else ()))
    ]


def make_files(folder: Path) -> None:
    for name, make in FILES.items():
        make(folder / name)


ACCEPTED_S = 4.0
ENDED_S = 60.0
PYTHON = re.compile(
    r"Traceback|Errno|codec|NoneType|invalid literal|could not convert|<class|object at|recursion"
    r"|list index|unpack|Error:|Exception|\bdict\b|expected str"
)
"""Words that only a Python programmer knows."""

ESCAPED = 99

LONGEST = 1500
"""Most characters of an error."""


def outcome(
    words: tuple[str, ...], folder: Path, accepted_s: float = ACCEPTED_S
) -> tuple[int | None, str]:
    """Exit status of a call, None if it had to be interrupted, and its standard error."""
    errors = folder / "stderr"
    child = os.fork()
    if child == 0:
        os._exit(_call(words, folder, errors))
    status = _wait(child, accepted_s)
    interrupted = status is None
    if interrupted:
        os.kill(child, signal.SIGINT)
        status = _wait(child, ENDED_S)
        if status is None:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return ESCAPED, "does not end by Ctrl-C"
    said = errors.read_text(errors="replace")
    return (None if interrupted and not PYTHON.search(said) else status), said


def _call(words: tuple[str, ...], folder: Path, errors: Path) -> int:
    os.setsid()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a script's & would ignore it
    os.chdir(tempfile.mkdtemp(dir=folder))
    for number, name in enumerate((os.devnull, os.devnull, errors)):
        os.dup2(os.open(name, os.O_RDWR | os.O_CREAT | os.O_TRUNC), number)
    sys.stdout = sys.stderr = io.TextIOWrapper(io.FileIO(2, "w", closefd=False), errors="replace")
    sys.unraisablehook = deliver_again
    try:
        status = main(words)
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else ESCAPED
    except BaseException:
        traceback.print_exc()
        status = ESCAPED
    if "multiprocessing.util" in sys.modules:
        sys.modules["multiprocessing.util"]._exit_function()  # else its helper prints
    sys.stderr.flush()
    return status


def _wait(child: int, seconds: float) -> int | None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    return None


def problem(status: int | None, said: str) -> str:
    """What is wrong with how a call ended; empty if nothing is."""
    lines = said.strip("\n").split("\n")
    if found := PYTHON.search(said):
        return f"speaks of Python, {found[0]}"
    if status in (None, 0):
        return ""
    if status not in (1, 2):
        return f"status {status}"
    if len(said) > LONGEST:
        return f"{len(said)} characters"
    return "" if len(lines) == 1 and lines[0].startswith("cubestack") else f"{len(lines)} lines"


def try_all(count: int, seed: int, accepted_s: float = ACCEPTED_S) -> int:
    """Try ``count`` cases, 0 for all, and print the bad ones; returns their number."""
    ends = Counter[str]()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        make_files(folder)
        found = cases(folder)
        for one in random.Random(seed).sample(found, count) if count else found:
            status, said = outcome(one.words, folder, accepted_s)
            wrong = problem(status, said)
            ends["bad" if wrong else "accepted" if status in (None, 0) else "refused"] += 1
            if wrong:
                print(f"{one.kind}: {wrong}: {said.strip()[-300:]!r}", flush=True)
    print(", ".join(f"{number} {end}" for end, number in sorted(ends.items())))
    return ends["bad"]


if __name__ == "__main__":
    sys.exit(try_all(*map(int, sys.argv[1:])) > 0)
