"""What a design keeps of a frame in the memory, and what it presents of the memory.

The shipped designs keep and present the frame as it is. For a design that changes the image, a
module of the user's says what is right:

- ``stored(frame)``: of a frame, a list of rows of pixels, the bank's bytes in the same layout;
  -1 where nothing is stored.
- ``presented(memory)``: of a bank's bytes, in that layout, what the data clocks present.

Both may return anything with rows of integers, also a NumPy array.
"""

import os
import sys
from dataclasses import dataclass
from importlib import import_module
from operator import index
from pathlib import Path
from typing import Any

from cubestack.hdl.user import GatewareError

#: Names the module, and the folder that it may lie in, for the simulator's process.
MODULE, FOLDER = "CONTRACT_IMAGE", "CONTRACT_FOLDER"


@dataclass(frozen=True)
class Image:
    """Of ``columns`` x ``rows`` pixels; ``module`` is the user's, or None."""

    columns: int
    rows: int
    module: Any = None

    def stored(self, frame: bytes) -> list[int]:
        """A bank's bytes in the order of the pixels; -1 for any."""
        if self.module is None:
            return [*frame]
        return self._called("stored", frame, -1)

    def presented(self, memory: bytes) -> bytes:
        return memory if self.module is None else bytes(self._called("presented", memory, 0))

    def holds(self, memory: bytes, frame: bytes) -> bool:
        """Whether ``memory``, a bank's first bytes, has what is to be stored of ``frame``."""
        wanted = self.stored(frame)
        return all(level in (-1, byte) for level, byte in zip(wanted, memory, strict=False))

    def _called(self, name: str, content: bytes, least: int) -> list[int]:
        starts = range(0, len(content), self.columns)
        rows = [[*content[start : start + self.columns]] for start in starts]
        returned = getattr(self.module, name)(rows)
        try:
            found = [[index(level) for level in row] for row in returned]
        except TypeError:
            found = []
        wrong = len(found) != self.rows or any(len(row) != self.columns for row in found)
        if wrong or any(not least <= level <= 255 for row in found for level in row):
            raise GatewareError(
                f"{self.module.__name__}.{name} must return {self.rows} rows of {self.columns} "
                f"integers from {least} to 255"
            )
        return [level for row in found for level in row]


def load_image(name: str, columns: int, rows: int, folder: Path | None = None) -> Image:
    """That of the module ``name``, which may lie in ``folder``; GatewareError for a wrong one."""
    if not name:
        return Image(columns, rows)
    place = str((folder or Path()).resolve())
    sys.path.insert(0, place)
    try:
        module = import_module(name)
    except Exception as error:
        raise GatewareError(f"--image {name}: {type(error).__name__}: {error}") from error
    finally:
        sys.path.remove(place)
    for function in ("stored", "presented"):
        if not callable(getattr(module, function, None)):
            raise GatewareError(f"--image {name}: the module has no function {function}")
    image = Image(columns, rows, module)
    sample = bytes(n * 37 % 256 for n in range(columns * rows))
    image.stored(sample), image.presented(sample)
    return image


def image_of_environment(columns: int, rows: int) -> Image:
    """The image in a simulator's process."""
    name, folder = os.environ.get(MODULE, ""), os.environ.get(FOLDER, ".")
    return load_image(name, columns, rows, Path(folder))
