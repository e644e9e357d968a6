"""Finds a C++ compiler and calls it."""

import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

FLAGS = ("-std=c++17", "-O2", "-DNDEBUG", "-fPIC", "-fno-semantic-interposition", "-shared")
"""Of every shared library."""


class CompilerError(RuntimeError):
    """The library could not be built."""


class NoCompilerError(CompilerError):
    """There is no C++ compiler."""


@dataclass(frozen=True)
class Compiler:
    """A C++ compiler: how it is called, and what tells it from every other one."""

    command: tuple[str, ...]
    identity: str

    @property
    def name(self) -> str:
        """For readers: name and version on one line."""
        return self.identity.splitlines()[:2][-1]

    def build_s(self, count: int) -> float:
        """Rough time to build ``count`` libraries on one core."""
        first = 50.0 if self.identity.startswith("ziglang") else 0.0  # builds its C++ library
        return first + 10.0 * count


@lru_cache(maxsize=8)
def _version_of(command: tuple[str, ...], _changed_ns: int) -> str | None:
    """What a program says of itself, None when it fails; asked once until it changes."""
    answer = subprocess.run([*command, "--version"], capture_output=True, text=True)
    return answer.stdout if answer.returncode == 0 else None


def find_compiler() -> Compiler | None:
    """Take ``$CXX``, else one on the PATH, else the one of the ziglang wheel, else None."""
    for candidate in (shlex.split(os.environ.get("CXX", "")), ["c++"], ["g++"], ["clang++"]):
        program = shutil.which(candidate[0]) if candidate else None
        if program is None:
            continue
        command = (program, *candidate[1:])
        version_text = _version_of(command, os.stat(program).st_mtime_ns)
        if version_text is not None:
            return Compiler(command, f"{shlex.join(command)}\n{version_text}")
    if importlib.util.find_spec("ziglang") is not None:
        command = (sys.executable, "-P", "-m", "ziglang", "c++")
        return Compiler(command, f"ziglang {version('ziglang')}")
    return None


def compile_library(
    compiler: Compiler, library: Path, log: Path, sources: Iterable[str | Path]
) -> Path:
    """Make ``library`` of ``sources`` and further options, with ``FLAGS``.

    CompilerError when the compiler fails; the message names the log.
    """
    options = [*FLAGS, *map(str, sources), "-o", str(library)]
    return run_compiler(compiler.command, options, library, log)


def run_compiler(command: Sequence[str], options: Sequence[str], library: Path, log: Path) -> Path:
    """Run ``command``, which must make ``library``; errors as of ``compile_library``."""
    whole = [*command, *options]
    with log.open("w") as output:
        output.write(shlex.join(whole) + "\n")
        output.flush()
        done = subprocess.run(whole, stdout=output, stderr=subprocess.STDOUT)
    if done.returncode != 0 or not library.exists():
        raise CompilerError(f"{shlex.join(command)} failed; its log is {log}")
    return library
