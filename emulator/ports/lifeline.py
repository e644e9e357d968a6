"""Ends an emulation when the process that started it ends, in whatever way."""

import os
import select
from collections.abc import Callable
from contextlib import suppress

from cubestack.emulator.ports.endpoint import Endpoint


class Lifeline(Endpoint):
    """The reading end of a pipe whose other end the parent process holds open."""

    name = "lifeline"

    def __init__(self, descriptor: int) -> None:
        """Watch ``descriptor``, and own it; OSError for an invalid one."""
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self.on_end: Callable[[], None] = lambda: None
        self._ended = False

    def watched(self) -> list[tuple[int, int]]:
        return [] if self._ended else [(self._descriptor, select.POLLIN)]

    def exchange(self, now_ps: int) -> None:
        """Call ``on_end`` if the other end was closed."""
        with suppress(BlockingIOError):
            if not self._ended and not os.read(self._descriptor, 1 << 12):
                self._ended = True
                self.on_end()

    def close(self) -> None:
        os.close(self._descriptor)
