"""Programs of others that the tests point at the emulator: where they are, and how to build them.

``clients.sh FOLDER`` installs them; with CUBESTACK_CLIENTS=FOLDER the tests find them there. What
is missing is skipped.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev.preload.shim import find_c_compiler

FOLDER = Path(os.environ.get("CUBESTACK_CLIENTS", "/nonexistent"))
ENVIRONMENT = {
    "PATH": f"{os.environ['PATH']}:/usr/sbin:/sbin",
    "NODE_PATH": str(FOLDER / "node_modules"),
}
BUILD_S = 300

Command = Callable[[Path, Path], list[str | Path]]
"""Returns the command for a source; gets a folder for what it builds."""


@dataclass(frozen=True)
class Client:
    """A program, and what it should find."""

    name: str  # with the version that was tried, for the documentation
    source: str  # file in the folder programs/
    command: Command
    refused: tuple[tuple[str, str], ...] = ()  # route or port that it can not use, and why

    def reason(self, where: str) -> str:
        """Why it can not use a route or port; empty if it can."""
        return dict(self.refused).get(where, "")


def tool(*names: str) -> list[str]:
    """A command whose first word must be there."""
    found = shutil.which(names[0], path=ENVIRONMENT["PATH"])
    if found is None:
        pytest.skip(f"no {names[0]} here")
    return [found, *names[1:]]


def interpreter(*words: str) -> Command:
    return lambda source, _folder: [*tool(*words), source]


def python(module: str, *words: str, venv: str = "venv") -> Command:
    """Python with a package: that of the clients' folder, or this one."""

    def command(source: Path, _folder: Path) -> list[str | Path]:
        own = FOLDER / venv / "bin" / "python"
        program = str(own) if own.exists() else sys.executable
        tried = subprocess.run([program, "-c", f"import {module}"], capture_output=True)
        if tried.returncode:
            pytest.skip(f"no {module} here")
        return [program, source, *words]

    return command


def node(package: str) -> Command:
    def command(source: Path, _folder: Path) -> list[str | Path]:
        program = tool("node")
        if not (FOLDER / "node_modules" / package).exists():
            pytest.skip(f"no npm {package} here")
        return [*program, source]

    return command


def perl(module: str) -> Command:
    def command(source: Path, _folder: Path) -> list[str | Path]:
        program = tool("perl")
        if subprocess.run([*program, f"-M{module}", "-e", "1"], capture_output=True).returncode:
            pytest.skip(f"no Perl {module} here")
        return [*program, source]

    return command


def built(*words: str) -> Command:
    """A compiler with options; ``cc`` is any C compiler."""

    def command(source: Path, folder: Path) -> list[str | Path]:
        compiler = find_c_compiler() if words[0] == "cc" else tool(words[0])
        if compiler is None:
            pytest.skip("no C compiler here")
        program = folder / "program"
        if program.exists():
            return [program]
        folder.mkdir()
        call = [*compiler, *words[1:], "-o", program, source]
        done = subprocess.run(call, capture_output=True, text=True, timeout=BUILD_S)
        if done.returncode:
            pytest.skip(f"{words[0]} can not build it: {done.stderr.strip().splitlines()[-1]}")
        return [program]

    return command


def table(clients: tuple[Client, ...], places: tuple[str, ...]) -> str:
    """The clients with what they can use; the documentation has this table."""
    rows = [
        f"| {client.name} | "
        + " | ".join(
            f"no: {client.reason(place)}" if client.reason(place) else "yes" for place in places
        )
        + " |"
        for client in clients
    ]
    head = f"| program | {' | '.join(places)} |"
    return "\n".join([head, "|-" * (1 + len(places)) + "|", *rows])
