"""Shared libraries of C++ code: shipped in a wheel, or compiled once and kept in the cache folder.

A file's name is the hash of what the library is made of and the hash of its own bytes, so that a
stale library is not found and a damaged one is not loaded. A shipped library depends on sources
and flags only; a compiled one also on the versions of the tools and of the compiler. Of processes
that need the same library, one compiles it and the others wait. It appears by renaming, as not
every file system has locks.
"""

import fcntl
import hashlib
import logging
import os
import platform
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

from cubestack.emulator.native import compiler as compilers
from cubestack.emulator.native.compiler import Compiler, CompilerError, NoCompilerError

SHIPPED = Path(__file__).parent / "libraries"
"""Libraries of the shipped devices, in wheels only; `cubestack.host.native.wheels` builds them."""

UNUSED_S = 90 * 86_400
"""Wall time after which an unused library is removed."""

_log = logging.getLogger(__name__)

Build = Callable[[Compiler, Path, Path], Path]
"""Takes the compiler, a scratch folder and the path of its log, and returns the library."""

Report = Callable[[str], AbstractContextManager[object]]
"""Shows a line of text as long as its block lasts."""


class Recipe(NamedTuple):
    """A library: its name for readers, what it is made of, and how it is built.

    ``inputs`` is a hash of design, sources and flags; ``tools`` one of what turns them into C++.
    """

    title: str
    inputs: bytes
    tools: bytes
    build: Build

    def key(self, compiler: Compiler) -> str:
        """Name of the library that ``compiler`` builds on this machine."""
        machine = f"{platform.machine()} {compiler.identity}".encode()
        return hash_of(self.inputs + self.tools + machine)


_lists: list[list[Recipe]] = []
_reports: list[Report] = []


@contextmanager
def collected() -> Iterator[list[Recipe]]:
    """Collect the recipes of requested libraries; each request raises NoCompilerError."""
    recipes: list[Recipe] = []
    _lists.append(recipes)
    try:
        yield recipes
    finally:
        _lists.remove(recipes)


@contextmanager
def reported(report: Report) -> Iterator[None]:
    """Have ``report`` show what is compiled within the block."""
    _reports.append(report)
    try:
        yield
    finally:
        _reports.remove(report)


def hash_of(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:24]


def cache_folder() -> Path:
    """Folder of the libraries: ``$XDG_CACHE_HOME/cubestack``, by default below ``~/.cache``.

    It belongs to this user, and nobody else can write to it. Where that is not possible, it is one
    among the temporary files.
    """
    try:
        base = os.environ.get("XDG_CACHE_HOME")
        folder = (Path(base) if base else Path.home() / ".cache") / "cubestack"
    except RuntimeError:  # the user has neither $HOME nor an entry in passwd(5)
        return _private_folder("the home folder", "is not known")
    there = next(path for path in (folder, *folder.parents) if path.exists())
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        return _private_folder(str(folder), "can not be written to")
    if there != folder:
        make_folder(folder)
    else:
        found = folder.stat()
        if found.st_uid != os.getuid():
            return _private_folder(str(folder), "belongs to another user")
        if found.st_mode & _BY_OTHERS:
            _close_to_others(folder, found.st_mode)
    return folder


_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def _close_to_others(folder: Path, mode: int) -> None:
    """Make ``folder`` private, and remove what others may have put there."""
    folder.chmod(stat.S_IMODE(mode) & ~_BY_OTHERS)
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
    _log.warning("others could write to %s: it was emptied, and is closed to them now", folder)


@cache
def _private_folder(wanted: str, reason: str) -> Path:
    """In place of ``wanted``; nobody else may have put a library there that we would load."""
    folder = Path(tempfile.gettempdir()) / f"cubestack-{os.getuid()}"
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found = folder.lstat()
    own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
    if not own or found.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        folder = Path(tempfile.mkdtemp(prefix="cubestack-"))
    _log.warning("%s %s; what is compiled is kept in %s", wanted, reason, folder)
    return folder


def recipe(
    title: str, content: str, sources: Iterable[Path], build: Build, tools: Iterable[bytes] = ()
) -> Recipe:
    """Recipe of a library made of ``content`` and the files ``sources`` with ``tools``."""
    inputs, versions = hashlib.sha256(), hashlib.sha256()
    for text in (content, *compilers.FLAGS):
        inputs.update(text.encode() + b"\0")
    for source in sources:
        inputs.update(source.read_bytes())
    for tool in tools:
        versions.update(tool)
    return Recipe(title, inputs.digest(), versions.digest(), build)


def library_of(wanted: Recipe, folder: Path | None = None) -> Path:
    """Path of a library: shipped, from the cache, or compiled now.

    ``$CXX`` chooses a compiler, so nothing shipped is used. ``folder`` replaces
    :func:`cache_folder`.

    Raises:
        NoCompilerError: there is no C++ compiler.
        CompilerError: it failed; the message names the log.
    """
    if _lists:
        _lists[-1].append(wanted)
        raise NoCompilerError("libraries are only listed")
    folder = folder or cache_folder()
    library = ready_library(wanted, folder)
    if library is not None:
        _log.info("loading %s from %s", wanted.title, library)
        return library
    compiler = compilers.find_compiler()
    if compiler is None:
        raise NoCompilerError(
            "no C++ compiler found (install g++ or clang++, or run: pip install ziglang)"
        )
    try:
        return _built(folder, compiler, wanted)
    except OSError as error:
        text = f"can not use the cache folder {folder} ({error.strerror})"
        raise CompilerError(f"{text}; XDG_CACHE_HOME names another one") from error


def ready_library(wanted: Recipe, folder: Path | None = None) -> Path | None:
    """Path of a library that is shipped or in the cache, None where it must be compiled."""
    if not os.environ.get("CXX") and (library := intact(SHIPPED, hash_of(wanted.inputs))):
        return library
    compiler = compilers.find_compiler()
    return _found(folder or cache_folder(), wanted.key(compiler)) if compiler else None


def make_folder(folder: Path) -> None:
    """Create ``folder``, to which only this user can write."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)


def intact(folder: Path, key: str) -> Path | None:
    """The library with ``key`` in its name whose bytes have the hash in its name."""
    names: list[str] = []
    with suppress(OSError):
        names = os.listdir(folder)
    files = [folder / one for one in names if one.startswith(f"{key}-")]
    return next((one for one in files if one.name == f"{key}-{hash_of(one.read_bytes())}.so"), None)


def _found(folder: Path, key: str) -> Path | None:
    library = intact(folder, key)
    if library is not None:
        with suppress(OSError):
            os.utime(library)  # it is in use
    return library


def _built(folder: Path, compiler: Compiler, wanted: Recipe) -> Path:
    make_folder(folder)
    key = wanted.key(compiler)
    log = folder / f"{key}.log"
    with _shown(wanted, compiler), log.open("a") as turn:
        with suppress(OSError):
            fcntl.flock(turn, fcntl.LOCK_EX)
        if (library := _found(folder, key)) is not None:  # while waiting
            return library
        for damaged in folder.glob(f"{key}-*.so"):
            damaged.unlink(missing_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            built = wanted.build(compiler, Path(scratch), log)
            library = folder / f"{key}-{hash_of(built.read_bytes())}.so"
            built.replace(library)
    _prune(folder)
    return library


def _shown(wanted: Recipe, compiler: Compiler) -> AbstractContextManager[object]:
    text = f"compiling {wanted.title} (once, about {compiler.build_s(1):.0f} s)"
    _log.info("%s with %s", text, compiler.name)
    return _reports[-1](text) if _reports else nullcontext()


def _prune(folder: Path) -> None:
    """Remove what has not been used for `UNUSED_S`."""
    oldest = time.time() - UNUSED_S
    for suffix in ("so", "log"):
        for path in folder.glob(f"*.{suffix}"):
            with suppress(OSError):
                if path.stat().st_mtime < oldest:
                    path.unlink()
