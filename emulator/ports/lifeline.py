"""Ends an emulation with whoever started it, by whichever way that ends."""

import os
import select
from collections.abc import Callable
from contextlib import suppress

from cubestack.emulator.ports.endpoint import Endpoint


class Lifeline(Endpoint):
    """The reading end of a pipe whose other end somebody holds open."""

    name = "lifeline"

    def __init__(self, descriptor: int) -> None:
        """Watch ``descriptor``, which is closed with this; OSError for none."""
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self.on_end: Callable[[], None] = lambda: None
        self._ended = False

    def watched(self) -> list[tuple[int, int]]:
        """The pipe, until its end."""
        return [] if self._ended else [(self._descriptor, select.POLLIN)]

    def exchange(self, now_ps: int) -> None:
        """See whether the other end is still held."""
        with suppress(BlockingIOError):
            if not self._ended and not os.read(self._descriptor, 1 << 12):
                self._ended = True
                self.on_end()

    def close(self) -> None:
        """Hold on to it no more."""
        os.close(self._descriptor)
