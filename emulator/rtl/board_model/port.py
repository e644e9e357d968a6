"""A simulated board behind a pseudo-terminal, as a real one is behind its serial port."""

import os
import pty
import select
import threading
import tty
from typing import Protocol, Self


class Board(Protocol):
    """Any board, simulated or modelled."""

    def receive(self, data: bytes) -> bytes:
        """Take bytes from the host; returns those to the host."""


class BoardPort:
    """Serves ``board`` in a thread between ``start`` and ``close``, or as a context.

    Attributes:
        path: of the terminal that a host opens.
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        # The slave stays open here, so that a host may close and open it again.
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self._stop_read, self._stop_write = os.pipe()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def start(self) -> Self:
        self._thread.start()
        return self

    def close(self) -> None:
        os.write(self._stop_write, b"x")
        self._thread.join()
        for file in (self._master, self._slave, self._stop_read, self._stop_write):
            os.close(file)

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.close()

    def wait(self) -> None:
        """Return when the board failed."""
        self._thread.join()

    def _serve(self) -> None:
        waiting = b""
        os.set_blocking(self._master, False)
        while True:
            writers = [self._master] if waiting else []
            reads, writes, _ = select.select([self._master, self._stop_read], writers, [])
            if self._stop_read in reads:
                return
            if self._master in reads:
                waiting += self._board.receive(os.read(self._master, 1 << 14))
            if self._master in writes:
                waiting = waiting[os.write(self._master, waiting) :]
