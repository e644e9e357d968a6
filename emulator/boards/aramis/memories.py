"""Contents of the large memories at power-up.

Boards that power up alike map the same file and have copies of the pages that they write: drawing,
coding and copying 44 MB takes much longer than the rest of a board.
"""

from functools import lru_cache
from tempfile import TemporaryFile

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.catalogue.flash_store import flash_image
from cubestack.firmware_model.aramis.hardware import FLASH_BYTES, SDRAM_BYTES


class Content:
    """Bytes of a memory."""

    def __init__(self, content: NDArray[np.uint8]) -> None:
        self._file = TemporaryFile()  # noqa: SIM115
        self._file.write(content.data)
        self._file.flush()

    def __del__(self) -> None:
        self._file.close()

    def copy(self) -> NDArray[np.uint8]:
        """A copy that can be written, shape (bytes,)."""
        return np.memmap(self._file, np.uint8, "c").view(np.ndarray)


@lru_cache(maxsize=1)
def undefined_sdram(seed: int, stream: tuple[int, ...]) -> tuple[Content, np.random.Generator]:
    """The SDRAM of board ``seed``, and the random numbers of ``stream`` that follow."""
    rng = np.random.default_rng([seed, *stream])
    words = rng.integers(1 << 64, size=SDRAM_BYTES // 8, dtype="<u8")
    return Content(words.view(np.uint8)), rng


@lru_cache(maxsize=1)
def flash_with(catalogue: Database | None) -> Content:
    """The flash with the coded ``catalogue``, erased without one; ValueError if it is too long."""
    flash = np.full(FLASH_BYTES, 0xFF, np.uint8)
    if catalogue is not None:
        coded = flash_image(catalogue.pack())
        flash[: len(coded)] = coded
    return Content(flash)
