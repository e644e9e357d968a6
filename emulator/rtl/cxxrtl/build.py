"""Builds libraries of driver and design once, and keeps them in the user's cache folder.

The key covers everything that the result depends on: the design and its wiring, the driver, the
CXXRTL runtime, the compiler and its flags. A library's file name carries the hash of its own bytes,
so that a damaged one is noticed, and it appears by renaming, so that two processes may build at
once.
"""

import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache, partial
from importlib.metadata import version
from pathlib import Path

from cubestack.emulator.rtl.cxxrtl.pins_header import pins_header
from cubestack.emulator.rtl.cxxrtl.variants import variant_text
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.flow.generate import cxxrtl_headers, cxxrtl_text, design_hash, rtlil_text

SOURCES = ("driver.cpp", "sram_model.h", "pins_header.py", "clock_steps.py", "variants.py")
FLAGS = ("-std=c++17", "-O2", "-DNDEBUG", "-fPIC", "-fno-semantic-interposition", "-shared")


class CompilerError(RuntimeError):
    """The library could not be built."""


class NoCompilerError(CompilerError):
    """There is no C++ compiler."""


@dataclass(frozen=True)
class Compiler:
    """A C++ compiler: how it is called, and what tells it from every other one."""

    command: tuple[str, ...]
    identity: str


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
        return Compiler((sys.executable, "-m", "ziglang", "c++"), f"ziglang {version('ziglang')}")
    return None


def cache_folder() -> Path:
    """Folder of the libraries: ``$XDG_CACHE_HOME/cubestack``, by default below ``~/.cache``."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "cubestack"


def library_for(wiring: Wiring, folder: Path | None = None) -> Path:
    """Shared library of the driver with ``wiring``, from the cache or built now.

    ``folder`` replaces :func:`cache_folder`; errors as :func:`cached_library`.
    """
    design = f"{_design_hash(wiring.component)}{pins_header(wiring, '')}{wiring.burst_levels}"
    return cached_library(design, partial(_compile, wiring), folder)


def cached_library(
    design: str, build: Callable[[Compiler, Path, Path], Path], folder: Path | None = None
) -> Path:
    """Shared library of the driver with what ``design`` says, from the cache or built now.

    ``build`` gets the compiler, a scratch folder and where its log goes, and returns the library.

    Raises:
        NoCompilerError: there is no C++ compiler.
        CompilerError: it failed; the message names the log.
    """
    compiler = find_compiler()
    if compiler is None:
        raise NoCompilerError("no C++ compiler (c++, g++, clang++ or the ziglang wheel) found")
    folder = folder or cache_folder()
    key = _key(design, compiler)
    try:
        for candidate in folder.glob(f"{key}-*.so"):
            if candidate.name == _library_name(key, candidate.read_bytes()):
                return candidate
            candidate.unlink(missing_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            built = build(compiler, Path(scratch), folder / f"{key}.log")
            library = folder / _library_name(key, built.read_bytes())
            built.replace(library)
    except OSError as error:
        text = f"can not use the cache folder {folder} ({error.strerror})"
        raise CompilerError(f"{text}; XDG_CACHE_HOME names another one") from error
    return library


def compile_driver(
    compiler: Compiler, scratch: Path, log: Path, options: Iterable[str] = ()
) -> Path:
    """Library of driver.cpp with the design.cpp and pins.h of the scratch folder.

    CompilerError when the compiler fails; the message names the log.
    """
    library = scratch / "library.so"
    sources = f"-I{scratch}", f"-I{cxxrtl_headers()}", str(_source("driver.cpp"))
    command = [*compiler.command, *FLAGS, *sources, *options, "-o", str(library)]
    with log.open("w") as output:
        output.write(shlex.join(command) + "\n")
        output.flush()
        done = subprocess.run(command, stdout=output, stderr=subprocess.STDOUT)
    if done.returncode != 0 or not library.exists():
        raise CompilerError(f"{shlex.join(compiler.command)} failed; its log is {log}")
    return library


# Kept, because a large design takes a good part of a second.
_design_hash = lru_cache(maxsize=8)(design_hash)


def _key(design: str, compiler: Compiler) -> str:
    digest = hashlib.sha256()
    for text in (design, compiler.identity, platform.machine(), *FLAGS):
        digest.update(text.encode() + b"\0")
    for source in SOURCES:
        digest.update(_source(source).read_bytes())
    for header in sorted(cxxrtl_headers().glob("**/*.h")):
        digest.update(header.read_bytes())
    return digest.hexdigest()[:24]


def _library_name(key: str, content: bytes) -> str:
    return f"{key}-{hashlib.sha256(content).hexdigest()[:24]}.so"


def _source(name: str) -> Path:
    return Path(__file__).parent / name


def _compile(wiring: Wiring, compiler: Compiler, scratch: Path, log: Path) -> Path:
    design = cxxrtl_text(wiring.component)
    (scratch / "design.cpp").write_text(design)
    rtlil = rtlil_text(wiring.component)
    variants = [variant_text(rtlil, levels) for levels in wiring.burst_levels]
    for number, variant in enumerate(variants):
        (scratch / f"variant_{number}.cpp").write_text(variant)
    (scratch / "pins.h").write_text(pins_header(wiring, design, variants))
    return compile_driver(compiler, scratch, log)
