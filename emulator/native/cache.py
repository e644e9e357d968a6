"""Keeps shared libraries in the user's cache folder.

The key covers everything that a library depends on: what its builder says, the compiler and its
flags. A library's file name carries the hash of its own bytes, so that a damaged one is noticed,
and it appears by renaming, so that two processes may build at once.
"""

import hashlib
import logging
import os
import platform
import stat
import tempfile
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path

from cubestack.emulator.native import compiler as compilers
from cubestack.emulator.native.compiler import Compiler, CompilerError, NoCompilerError

UNUSED_S = 90 * 86_400
"""Wall time after which a library that nobody used makes room for others."""

_log = logging.getLogger(__name__)


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
    content: str,
    sources: Iterable[Path],
    build: Callable[[Compiler, Path, Path], Path],
    folder: Path | None = None,
) -> Path:
    """Shared library of what ``content`` and the files ``sources`` say, from the cache or built.

    ``build`` gets the compiler, a scratch folder and where its log goes, and returns the library.
    ``folder`` replaces :func:`cache_folder`.

    Raises:
        NoCompilerError: there is no C++ compiler.
        CompilerError: it failed; the message names the log.
    """
    compiler = compilers.find_compiler()
    if compiler is None:
        raise NoCompilerError("no C++ compiler (c++, g++, clang++ or the ziglang wheel) found")
    folder = folder or cache_folder()
    key = _key(content, sources, compiler)
    try:
        for candidate in folder.glob(f"{key}-*.so"):
            if candidate.name == _library_name(key, candidate.read_bytes()):
                with suppress(OSError):
                    os.utime(candidate)  # it is in use
                return candidate
            candidate.unlink(missing_ok=True)
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            built = build(compiler, Path(scratch), folder / f"{key}.log")
            library = folder / _library_name(key, built.read_bytes())
            built.replace(library)
        _prune(folder)
    except OSError as error:
        text = f"can not use the cache folder {folder} ({error.strerror})"
        raise CompilerError(f"{text}; XDG_CACHE_HOME names another one") from error
    return library


def _prune(folder: Path) -> None:
    """Remove what has not been used for `UNUSED_S`."""
    oldest = time.time() - UNUSED_S
    for suffix in ("so", "log"):
        for path in folder.glob(f"*.{suffix}"):
            with suppress(OSError):
                if path.stat().st_mtime < oldest:
                    path.unlink()


def _key(content: str, sources: Iterable[Path], compiler: Compiler) -> str:
    digest = hashlib.sha256()
    for text in (content, compiler.identity, platform.machine(), *compilers.FLAGS):
        digest.update(text.encode() + b"\0")
    for source in sources:
        digest.update(source.read_bytes())
    return digest.hexdigest()[:24]


def _library_name(key: str, content: bytes) -> str:
    return f"{key}-{hashlib.sha256(content).hexdigest()[:24]}.so"
