"""When programs open and close a file: inotify(7), so that none is missed between two looks."""

import ctypes
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager

IN_CLOSE_WRITE, IN_CLOSE_NOWRITE, IN_OPEN = 0x08, 0x10, 0x20
BUFFER_BYTES = 4096
_EVENT = struct.Struct("=iIII")  # watch, kind, cookie, length of the name that follows


class Openings:
    """The programs that have a file open.

    Attributes:
        fd: readable when one has opened or closed it.
    """

    def __init__(self, path: str) -> None:
        """Watch ``path``, which nobody has open; raises OSError where that is not possible."""
        libc = ctypes.CDLL(None, use_errno=True)
        if not hasattr(libc, "inotify_init1"):
            raise OSError("no inotify here")
        self.fd = libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
        kinds = IN_OPEN | IN_CLOSE_WRITE | IN_CLOSE_NOWRITE
        if self.fd < 0 or libc.inotify_add_watch(self.fd, os.fsencode(path), kinds) < 0:
            number = ctypes.get_errno()
            if self.fd >= 0:
                os.close(self.fd)
            raise OSError(number, f"can not watch {path}: {os.strerror(number)}")
        self._open = 0
        self._own_opens = self._own_closes = 0

    def ended(self) -> bool:
        """Whether the last program has closed the file since the last call, if only for a time."""
        ended = False
        for opened in self._events():
            if opened and self._own_opens:
                self._own_opens -= 1
            elif not opened and self._own_closes:
                self._own_closes -= 1
            else:
                self._open += 1 if opened else -1
                ended = ended or self._open == 0
        return ended

    @contextmanager
    def own(self) -> Iterator[None]:
        """This process opens the file once inside, and closes it; that does not count."""
        self._own_opens += 1
        self._own_closes += 1
        yield

    def close(self) -> None:
        os.close(self.fd)

    def _events(self) -> Iterator[bool]:
        """True per opening, False per closing."""
        while True:
            try:
                data = os.read(self.fd, BUFFER_BYTES)
            except BlockingIOError:
                return
            position = 0
            while position < len(data):
                _, kind, _, length = _EVENT.unpack_from(data, position)
                position += _EVENT.size + length
                if kind & (IN_OPEN | IN_CLOSE_WRITE | IN_CLOSE_NOWRITE):
                    yield bool(kind & IN_OPEN)
