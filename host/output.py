"""Files that the user named for a command to write.

A start that fails changes no file: until a file is kept, its content is in a hidden file beside it.
A file that grows while a command runs, such as a recording, is kept when the command has started
(``Outputs.keep``), any other one when it is whole. Two processes never write the same file. The
command line refuses to replace a file without ``--force`` (``cli.arguments.add_output``).
"""

import contextlib
import errno
import fcntl
import io
import os
import stat
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import TypeAlias

PART = ".{}.part"
"""Name of a file that is not kept yet."""


class OutputFile(io.TextIOWrapper):
    """A file that is being written; raises OSError if it can not be, or if it is already.

    Attributes:
        before_kept: called before the file gets its name; an OSError prevents that.
    """

    def __init__(self, path: Path) -> None:
        self._place = Path(os.path.realpath(path))
        self._replaces = self._place.exists()
        self._part: Path | None = None
        if self._replaces and not self._place.is_file():  # a pipe, a terminal, /dev/null
            fd = os.open(self._place, os.O_WRONLY | os.O_CLOEXEC)
        else:
            self._part = self._place.with_name(PART.format(self._place.name))
            fd = _lock(self._part)
            try:
                _check_unlocked(self._place)
            except OSError:
                self._part.unlink()
                os.close(fd)
                raise
            os.truncate(fd, 0)
        self._path = path
        self.before_kept: Callable[[], None] = lambda: None
        super().__init__(os.fdopen(fd, "wb"), encoding="utf-8", newline="")

    @property
    def name(self) -> str:
        """The path, as it was given."""
        return str(self._path)

    def keep(self) -> None:
        """Give the file its name; what follows is appended to it. Raises OSError."""
        self.flush()
        if self._part is None:
            return
        self.before_kept()
        if not self._place.exists():
            pass
        elif self._replaces:
            os.fchmod(self.fileno(), stat.S_IMODE(self._place.stat().st_mode))
        else:
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), self._place)
        self._part.replace(self._place)
        self._part = None

    def drop(self) -> None:
        """Leave what is there, unless the file is kept already; nothing more is written."""
        if self._part is not None:
            self._part.unlink(missing_ok=True)
            self._part = None

    def end(
        self,
        kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        """Close the file; keep it unless there was an error. Raises OSError."""
        try:
            if kind is None:
                self.keep()
        finally:
            self.drop()
            with contextlib.suppress(OSError):  # nobody will see the file, or knows already
                self.close()


class Outputs(ExitStack):
    """The files of a command, and what else ends with it.

    At its end it keeps the files, but if the end is an error only those that are kept already.
    """

    def __init__(self) -> None:
        super().__init__()
        self._files: list[OutputFile] = []

    def create(self, path: Path) -> OutputFile:
        """Open ``path`` for writing; raises ValueError if that is not possible."""
        try:
            file = OutputFile(path)
        except OSError as error:
            raise ValueError(f"can not write {path}: {error.strerror}") from None
        self._files.append(file)
        self.push(file.end)
        return file

    def keep(self) -> None:
        """Give the files their names; call it when the command has started."""
        for file in self._files:
            file.keep()

    def drop(self) -> None:
        """Leave the files that were there, unless these are kept already."""
        for file in self._files:
            file.drop()


Files: TypeAlias = Mapping[str, str | bytes]
"""Contents by path in a folder."""


def write_output(path: Path, content: str | bytes) -> None:
    """Write a whole file; raises ValueError if that is not possible."""
    write_outputs(path.parent, {path.name: content})


def write_outputs(folder: Path, files: Files) -> None:
    """Write whole files into a folder that exists: all or, with a ValueError, none."""
    with Outputs() as outputs:
        for name, content in files.items():
            file = outputs.create(folder / name)
            try:
                file.buffer.write(content.encode() if isinstance(content, str) else content)
                file.flush()
            except OSError as error:
                raise ValueError(f"can not write {folder / name}: {error.strerror}") from None


def output_folder(path: Path) -> Path:
    """Create a folder unless it exists; raises ValueError if that is not possible."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"can not write {path}: {error.strerror}") from None
    return path


def write_new_folder(path: Path, files: Files) -> None:
    """Write a folder that does not exist yet; raises ValueError if it does, or can not be."""
    if path.exists():
        raise ValueError(f"{path} exists; remove it, or choose another folder with --out")
    place = Path(os.path.realpath(path))
    output_folder(place.parent)
    with TemporaryDirectory(prefix=f".{place.name}.", dir=place.parent) as scratch:
        whole = Path(scratch) / place.name
        for name in files:
            output_folder((whole / name).parent)
        write_outputs(whole, files)
        try:
            whole.rename(place)
        except OSError as error:
            raise ValueError(f"can not write {path}: {error.strerror}") from None


def _lock(part: Path) -> int:
    """Open a file that is not kept yet; raises OSError if another process has it."""
    while True:
        fd = os.open(part, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
        try:
            _take(fd)
            if os.path.samestat(os.fstat(fd), os.stat(part)):
                return fd
        except FileNotFoundError:
            pass  # another process kept or removed it just now
        except OSError:
            os.close(fd)
            raise
        os.close(fd)


def _check_unlocked(place: Path) -> None:
    with contextlib.suppress(FileNotFoundError, PermissionError):
        fd = os.open(place, os.O_RDONLY | os.O_CLOEXEC)
        try:
            _take(fd)
        finally:
            os.close(fd)


def _take(fd: int) -> None:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise BlockingIOError(errno.EBUSY, "it is being written already") from None
