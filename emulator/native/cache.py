"""Keeps shared libraries in the user's cache folder.

The key covers everything that a library depends on: what its builder says, the compiler and its
flags; not the compiler where the library came along ready-made. A library's file name carries the
hash of its own bytes, so that a damaged one is noticed. Of processes that want the same one at
once, one builds it and the others wait; it appears by renaming, as not every file system has locks.
"""

import fcntl
import hashlib
import logging
import os
import platform
import stat
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

from cubestack.emulator.native import compiler as compilers
from cubestack.emulator.native.compiler import Compiler, CompilerError, NoCompilerError
from cubestack.emulator.native.ready_made import hash_of, ready_made

UNUSED_S = 90 * 86_400
"""Wall time after which a library that nobody used makes room for others."""

_log = logging.getLogger(__name__)

Build = Callable[[Compiler, Path, Path], Path]
"""Gets the compiler, a scratch folder and where its log goes, and returns the library."""


class Wanted(NamedTuple):
    """A library that somebody asked for: all that it is made of, and how."""

    inputs: bytes
    build: Build


_asked: list[list[Wanted]] = []


@contextmanager
def noted() -> Iterator[list[Wanted]]:
    """Note every library that is asked for meanwhile."""
    wanted: list[Wanted] = []
    _asked.append(wanted)
    try:
        yield wanted
    finally:
        _asked.remove(wanted)


def cache_folder() -> Path:
    """Folder of the libraries: ``$XDG_CACHE_HOME/cubestack``, by default below ``~/.cache``.

    Where that can not be written to, one among the temporary files that is this user's alone.
    """
    base = os.environ.get("XDG_CACHE_HOME")
    folder = (Path(base) if base else Path.home() / ".cache") / "cubestack"
    there = next(path for path in (folder, *folder.parents) if path.exists())
    if there.is_dir() and os.access(there, os.W_OK | os.X_OK):
        return folder
    return _private_folder(folder)


@cache
def _private_folder(wanted: Path) -> Path:
    """In place of ``wanted``; nobody else may have put a library there that we would load."""
    folder = Path(tempfile.gettempdir()) / f"cubestack-{os.getuid()}"
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found = folder.lstat()
    own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
    if not own or found.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        folder = Path(tempfile.mkdtemp(prefix="cubestack-"))
    _log.warning("%s can not be written to; what is compiled is kept in %s", wanted, folder)
    return folder


def cached_library(
    content: str, sources: Iterable[Path], build: Build, folder: Path | None = None
) -> Path:
    """Shared library of what ``content`` and the files ``sources`` say.

    From the cache, of those that come along, or built. ``folder`` replaces :func:`cache_folder`.

    Raises:
        NoCompilerError: there is no C++ compiler.
        CompilerError: it failed; the message names the log.
    """
    inputs = _inputs(content, sources)
    for wanted in _asked:
        wanted.append(Wanted(inputs, build))
    folder = folder or cache_folder()
    ready = ready_made(inputs)
    try:
        if ready is not None:
            digest, library = ready
            path = folder / f"{hash_of(inputs)}-{digest}.so"
            _log.info("ready-made library %s", path.name)
            return _found(folder, hash_of(inputs)) or _kept(path, library)
        compiler = compilers.find_compiler()
        if compiler is None:
            raise NoCompilerError(
                "no C++ compiler (c++, g++, clang++ or that of pip install 'cubestack[compiler]') "
                "found"
            )
        key = hash_of(inputs + f"{platform.machine()} {compiler.identity}".encode())
        return _found(folder, key) or _built(folder, key, compiler, build)
    except OSError as error:
        text = f"can not use the cache folder {folder} ({error.strerror})"
        raise CompilerError(f"{text}; XDG_CACHE_HOME names another one") from error


def _found(folder: Path, key: str) -> Path | None:
    for candidate in folder.glob(f"{key}-*.so"):
        if candidate.stem == f"{key}-{hash_of(candidate.read_bytes())}":
            with suppress(OSError):
                os.utime(candidate)  # it is in use
            return candidate
        candidate.unlink(missing_ok=True)
    return None


def _built(folder: Path, key: str, compiler: Compiler, build: Build) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / f"{key}.log"
    with log.open("a") as turn:
        with suppress(OSError):
            fcntl.flock(turn, fcntl.LOCK_EX)
        if (library := _found(folder, key)) is not None:  # while waiting
            return library
        _log.info("compiling into %s with %s", folder, " ".join(compiler.command))
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            built = build(compiler, Path(scratch), log)
            library = folder / f"{key}-{hash_of(built.read_bytes())}.so"
            built.replace(library)
    _prune(folder)
    return library


def _kept(path: Path, library: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent) as scratch:
        written = Path(scratch) / path.name
        written.write_bytes(library)
        written.replace(path)
    _prune(path.parent)
    return path


def _prune(folder: Path) -> None:
    """Remove what has not been used for `UNUSED_S`."""
    oldest = time.time() - UNUSED_S
    for suffix in ("so", "log"):
        for path in folder.glob(f"*.{suffix}"):
            with suppress(OSError):
                if path.stat().st_mtime < oldest:
                    path.unlink()


def _inputs(content: str, sources: Iterable[Path]) -> bytes:
    """All that a library is made of, on any machine and by any compiler."""
    digest = hashlib.sha256()
    for text in (content, *compilers.FLAGS):
        digest.update(text.encode() + b"\0")
    for source in sources:
        digest.update(source.read_bytes())
    return digest.digest()
