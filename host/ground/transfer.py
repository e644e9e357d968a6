"""A picture on its way over the wire, down or up: how far it is, held, and given up."""

import threading
import warnings
from collections.abc import Callable
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cubestack.host.clients.contract import Progress
from cubestack.host.errors import HostError
from cubestack.host.ground.emulation import JsonObject
from cubestack.host.pictures.images import png


class GivenUpError(HostError):
    """Somebody gave the transfer up."""


class Transfer:
    """Attributes:
    what: "download" or "upload", for whoever shows it.
    picture: what a download gave, as PNG; None before its end.
    """

    def __init__(self, what: str, perform: Callable[[Progress], NDArray[np.uint8] | None]) -> None:
        """To be ``run``; ``perform`` tells its progress, and gives the picture of a download."""
        self.what, self._perform = what, perform
        self.picture: bytes | None = None
        self._blocks = (0, 0)
        self._goes_on = threading.Event()
        self._goes_on.set()
        self._given_up = False
        self._ended = ""

    @property
    def runs(self) -> bool:
        """Whether it keeps the line to itself."""
        return not self._ended

    @property
    def state(self) -> JsonObject:
        """For a page; ``ended`` is "" on the way, "done", or why it ended before."""
        done, total = self._blocks
        held = self.runs and not self._goes_on.is_set()
        return {
            "what": self.what,
            "done": done,
            "total": total,
            "held": held,
            "ended": self._ended,
            "saved": self.picture is not None,
        }

    def run(self) -> None:
        """Perform it, in the thread that asks the target."""
        try:
            self._step(0, 0)
            picture = self._perform(self._step)
            self.picture = None if picture is None else png(picture)
            self._ended = "done"
        except (HostError, ValueError) as error:
            self._ended = str(error)
        except BaseException as error:
            self._ended = f"it failed: {error!r}"
            raise

    def hold(self) -> None:
        """Ask for nothing more until it is to go on; a stream waits in the line's buffers."""
        self._goes_on.clear()

    def go_on(self) -> None:
        self._goes_on.set()

    def give_up(self) -> None:
        """End it after the block that is under way."""
        self._given_up = True
        self._goes_on.set()

    def _step(self, done: int, total: int) -> None:
        self._blocks = (done, total)
        self._goes_on.wait()
        if self._given_up:
            raise GivenUpError(f"given up after {done} of {total} blocks")


def grey_values(content: bytes) -> NDArray[np.uint8]:
    """Grey values (rows, columns) of a picture file; ValueError for what is none."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(BytesIO(content))
        with image:
            return np.asarray(image.convert("L"))
    except (OSError, Image.DecompressionBombError) as error:
        raise ValueError(f"that is no picture: {error}") from None
