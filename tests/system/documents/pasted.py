"""Runs the commands of README.md and docs/ in their order, in a fresh clone.

``python -m tests.system.documents.pasted`` clones the project and runs every shell block of
README.md and of each page, line by line in one shell per document. A server runs until its document
ends or the next server starts; scripts of README.md run beside it. The tutorial runs in an empty
folder.

Prints the result and duration of each command, or why it was skipped; exit status 1 if one failed.
``--long`` includes commands that take minutes to hours.
"""

import argparse
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import NamedTuple

from .blocks import (
    LEFT,
    LONG,
    MAKES_PORT,
    ROOT,
    SERVES,
    Code,
    blocks,
    lines_of,
    own_call,
    reader_files,
    words_of,
)

MARK = "-- pasted, exit status"
READY = "Ctrl-C ends it"
LONG_TARGETS = {
    "test",
    "test-all",
    "test-hdl",
    "test-clients",
    "test-suites",
    "mutants",
    "bench-engines",
    "libraries",
}
EMPTY_FOLDER = {"tutorial.md", "bare-part.md"}
ENDING_S = 20.0
TOLD = 15
"""Lines of what failed."""


class Pasted(NamedTuple):
    """A command and its result; ``code`` is None if it was skipped."""

    document: str
    line: str
    code: int | None
    seconds: float
    said: str

    @property
    def good(self) -> bool:
        return not self.code

    def __str__(self) -> str:
        ended = "left out" if self.code is None else "failed" if self.code else "ok"
        told = f": {self.said}" if self.code or self.code is None else ""
        return f"{self.document}  {ended:8} {self.seconds:6.1f} s  {self.line}{told}"


class Shell:
    """A bash with job control, as in a terminal."""

    def __init__(self, folder: Path) -> None:
        """Starts it in ``folder`` without the virtual environment of this process."""
        own = os.environ.get("VIRTUAL_ENV")
        path = [one for one in os.environ["PATH"].split(":") if not own or own not in one]
        dropped = {"VIRTUAL_ENV", "PYTHONPATH", "PYTHONHOME"}
        environment = {name: value for name, value in os.environ.items() if name not in dropped}
        self.folder = folder
        self._process = subprocess.Popen(
            ["bash", "--noprofile", "--norc"],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            env=environment | {"PATH": ":".join(path)},
            # As in a terminal, also where this process was started to run in the background.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        self._said = SimpleQueue[str | None]()
        self._listener = Thread(target=self._listen, daemon=True)
        self._listener.start()
        self._served: list[int] = []
        self.run("set -m", 10.0)

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._said.put(line.rstrip())
        self._said.put(None)

    def run(self, line: str, limit_s: float) -> tuple[int, list[str]]:
        """Exit status and output; interrupts the command after ``limit_s``."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{{ {line}\n}} </dev/null\nprintf '\\n{MARK} %s\\n' $?\n")
        self._process.stdin.flush()
        until, said, last = time.monotonic() + limit_s, list[str](), list[str]()
        while True:
            try:
                heard = self._said.get(timeout=max(0.0, until - time.monotonic()))
            except Empty:
                last = [f"interrupted after {limit_s:.0f} s"]
                self._interrupt()
                until = time.monotonic() + ENDING_S
                continue
            if heard is None:
                return 1, [*said, "the shell ended"]
            if heard.startswith(MARK):
                return int(heard.removeprefix(MARK)), said + last
            said.append(heard)

    def _interrupt(self) -> None:
        """Ends the command with its children; Ctrl-C would end the shell as well."""
        tasks = Path(f"/proc/{self._process.pid}/task").glob("*/children")
        for child in {int(one) for task in tasks for one in task.read_text().split()}:
            if child not in self._served:
                with suppress(ProcessLookupError):
                    os.killpg(child, signal.SIGTERM)

    def serve(self, line: str, limit_s: float) -> tuple[int, list[str]]:
        """Ends the previous server, starts this one and waits until it is ready."""
        self.hang_up()
        log = self.folder / "served.log"
        log.write_text("")
        code, said = self.run(f"{line.split(' #')[0]} >{log} 2>&1 & echo $!", 10.0)
        process = int(next(word for word in said if word.isdecimal()))
        until = time.monotonic() + limit_s
        while READY not in log.read_text():
            if time.monotonic() > until or not Path(f"/proc/{process}").exists():
                return 1, log.read_text().splitlines()
            time.sleep(0.05)
        self._served.append(process)
        return code, log.read_text().splitlines()

    def hang_up(self) -> None:
        while self._served:
            process = self._served.pop()
            with suppress(ProcessLookupError):  # it may have ended by itself
                os.killpg(process, signal.SIGINT)
            self.run(f"wait {process}", ENDING_S)

    def close(self) -> None:
        self.hang_up()
        self._process.communicate("exit\n", ENDING_S)
        self._listener.join(ENDING_S)


def left_out(line: str, folder: Path, *, long: bool) -> str:
    """Why a line is skipped; empty if it is run."""
    words = words_of(line)
    if words[0] == "make" and not long and LONG_TARGETS & set(words):
        return "takes minutes"
    call = own_call(words)
    if call is not None:
        port = re.search(r"\./tty\S*", call)
        if port is not None and (re.search(MAKES_PORT, call) or (folder / port[0]).exists()):
            call = call.replace(port[0], "PORT")  # it is served, or will be
        for left, reason in LEFT.items():
            if re.search(left, call):
                return reason
        if not long and re.search(LONG, call):
            return "minutes to hours"
    typed = shlex.join(words)
    readers = "PROGRAM", "my_script", "picture.elf", "./star", "glow-sensor", "dask", "--lg-env"
    if any(word in typed for word in readers):
        return "the reader's turn"
    if "compiled_costs" in typed or "/etc/apt/" in typed:
        return "as root, on an empty Debian"
    return ""


def pasted(
    document: Path, folder: Path, *, long: bool, limit_s: float, ready: Sequence[str] = ()
) -> Iterator[Pasted]:
    """Runs the blocks of ``document`` in a shell in ``folder``, after the lines ``ready``."""
    shell = Shell(folder)
    try:
        for line in ready:
            shell.run(line, limit_s)
        for number, block in enumerate(blocks(document)):
            if block.language == "sh":
                for line in lines_of(block.text):
                    yield _paste(shell, document.name, line, long=long, limit_s=limit_s)
            elif block.language == "python":
                yield from _paste_python(shell, block, number, limit_s)
    finally:
        shell.close()


def _paste(shell: Shell, document: str, line: str, *, long: bool, limit_s: float) -> Pasted:
    shown = shlex.join(words_of(line))
    if reason := left_out(line, shell.folder, long=long):
        return Pasted(document, shown, None, 0.0, reason)
    call, started = own_call(words_of(line)), time.monotonic()
    serves = call is not None and re.search(SERVES, call)
    code, said = (shell.serve if serves else shell.run)(line, limit_s)
    heard = [one for one in said if one.strip()]
    told = "\n    ".join(["", *heard[-TOLD:]]) if code else (heard or [""])[-1]
    return Pasted(document, shown, code, time.monotonic() - started, told)


def _paste_python(shell: Shell, block: Code, number: int, limit_s: float) -> Iterator[Pasted]:
    """Saves a block that names its file; runs scripts of README.md."""
    named = re.match(r"# (\w+\.py)\n", block.text)
    name = named[1] if named else f"pasted{number}.py"
    if named or block.document == "README.md":
        (shell.folder / name).write_text(block.text, "utf-8")
    if not named and block.document == "README.md":
        line = f".venv/bin/python {name}"
        yield _paste(shell, block.document, line, long=True, limit_s=limit_s)


def fresh(folder: Path) -> Path:
    """A fresh copy of the project in ``folder``."""
    if (ROOT / ".git").exists():
        subprocess.run(["git", "clone", "-q", str(ROOT), str(folder)], check=True)
    else:
        made = shutil.ignore_patterns(".venv", "out", "build", "*.egg-info", "__pycache__")
        shutil.copytree(ROOT, folder, ignore=made)
    return folder


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("documents", nargs="*", help="README.md, docs/….md; default: all")
    parser.add_argument("--long", action="store_true", help="those too that take minutes to hours")
    parser.add_argument("--limit", type=float, default=900.0, metavar="S", help="of a command")
    args = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory(prefix="pasted-") as base:
        clone = fresh(Path(base) / "cubestack")
        pages = (str(one.relative_to(clone)) for one in sorted((clone / "docs").rglob("*.md")))
        for name in args.documents or ("README.md", *pages):
            document, ready = clone / name, list[str]()
            folder = clone
            if document.name in EMPTY_FOLDER:
                folder = Path(base) / document.stem  # beside the clone, as the page says
                folder.mkdir()
            elif document.name != "README.md":
                ready = ["make -s venv", ". .venv/bin/activate"]
                for file, content in reader_files().items():
                    (folder / file).write_text(content, "utf-8")
            for one in pasted(document, folder, long=args.long, limit_s=args.limit, ready=ready):
                print(one, flush=True)
                bad += not one.good
    print(f"{bad} failed" if bad else "all went well")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
