"""Simulated boards behind pseudo-terminals, as real ones are behind their serial ports."""

import os
import pty
import select
import threading
import tty
from contextlib import suppress
from typing import Self

from cubestack.emulator.rtl.board_model.board import SimulatedBoards

_PIECE = 1 << 14  # bytes that are taken from a host at once


class BoardPorts:
    """Serves ``boards`` in a thread between ``start`` and ``close``, or as a context.

    Attributes:
        paths: of the terminals that hosts open, one a board.
    """

    def __init__(self, boards: SimulatedBoards) -> None:
        self._boards = boards
        # The slaves stay open here, so that a host may close and open its own again.
        pairs = [pty.openpty() for _ in range(len(boards))]
        self._masters = {master: board for board, (master, _) in enumerate(pairs)}
        self._slaves = [slave for _, slave in pairs]
        for master, slave in pairs:
            tty.setraw(slave)
            os.set_blocking(master, False)
        self.paths = [os.ttyname(slave) for slave in self._slaves]
        self._stop_read, self._stop_write = os.pipe()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def start(self) -> Self:
        self._thread.start()
        return self

    def close(self) -> None:
        os.write(self._stop_write, b"x")
        self._thread.join()
        for file in (*self._masters, *self._slaves, self._stop_read, self._stop_write):
            os.close(file)

    def __enter__(self) -> Self:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.close()

    def wait(self) -> None:
        """Return when the boards failed."""
        self._thread.join()

    def _serve(self) -> None:
        count = len(self._boards)
        to_board = [bytearray() for _ in range(count)]
        to_host = [bytearray() for _ in range(count)]
        while True:
            readers = [master for master, n in self._masters.items() if len(to_board[n]) < _PIECE]
            writers = [master for master, n in self._masters.items() if to_host[n]]
            busy = any(to_board) or not all(map(self._boards.idle, range(count)))
            reads, writes, _ = select.select(
                [*readers, self._stop_read], writers, [], 0 if busy else None
            )
            if self._stop_read in reads:
                return
            for master in reads:
                to_board[self._masters[master]] += os.read(master, _PIECE)
            for master in writes:
                waiting = to_host[self._masters[master]]
                with suppress(BlockingIOError):
                    del waiting[: os.write(master, waiting)]
            if any(to_board) or busy:
                for waiting, received in zip(to_host, self._boards.run(to_board), strict=True):
                    waiting += received
