"""Image transfers over the wire: progress, pause, cancel."""

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.picture import decode_picture
from cubestack.host.clients.contract import Progress
from cubestack.host.errors import HostError
from cubestack.host.ground.emulation import JsonObject
from cubestack.host.pictures.images import png


class TransferCancelledError(HostError):
    """A user cancelled the transfer."""


class Transfer:
    """Attributes:
    what: "download" or "upload".
    picture: the downloaded image as PNG; None before the end of a download.
    """

    def __init__(self, what: str, perform: Callable[[Progress], NDArray[np.uint8] | None]) -> None:
        """``perform`` reports its progress, and returns the image of a download."""
        self.what, self._perform = what, perform
        self.picture: bytes | None = None
        self._blocks = (0, 0)
        self._resumed = threading.Event()
        self._resumed.set()
        self._cancelled = False
        self._ended = ""

    @property
    def runs(self) -> bool:
        return not self._ended

    @property
    def state(self) -> JsonObject:
        """``ended`` is "" in progress, "done", or the error; ``done`` and ``total`` are blocks."""
        done, total = self._blocks
        paused = self.runs and not self._resumed.is_set()
        return {
            "what": self.what,
            "done": done,
            "total": total,
            "paused": paused,
            "ended": self._ended,
            "saved": self.picture is not None,
        }

    def run(self) -> None:
        """Perform it, in the thread of the target's requests."""
        try:
            self._step(0, 0)
            picture = self._perform(self._step)
            self.picture = None if picture is None else png(picture)
            self._ended = "done"
        except (HostError, ValueError) as error:
            self._ended = str(error)
        except BaseException as error:
            self._ended = f"failed: {error!r}"
            raise

    def pause(self) -> None:
        """Request no more blocks until ``resume``; a stream waits in the line's buffers."""
        self._resumed.clear()

    def resume(self) -> None:
        self._resumed.set()

    def cancel(self) -> None:
        """End it after the current block."""
        self._cancelled = True
        self._resumed.set()

    def _step(self, done: int, total: int) -> None:
        self._blocks = (done, total)
        self._resumed.wait()
        if self._cancelled:
            raise TransferCancelledError(f"cancelled after {done} of {total} blocks")


def grey_values(content: bytes) -> NDArray[np.uint8]:
    """Grey values (rows, columns) of an image file; raises ValueError for any other file."""
    return decode_picture(content, "the uploaded file")
