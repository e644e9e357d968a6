"""Pictures in FITS, the format of astronomy (FITS standard 4.0).

Sections 3.1 (blocks of 2880 bytes), 4.1 and 4.2 (cards of 80 characters), 4.4.1 (sizes and scale)
and 5 (big-endian values). Compressed images are not read: others' data would decide the effort.
"""

import re

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.file import SceneError

FITS_START = b"SIMPLE  ="

BLOCK, CARD = 2880, 80
MOST_BLOCKS = 100
"""Blocks of one header."""

MOST_UNITS = 100
"""Headers that are looked through for an image."""

PIXELS = {8: ">u1", 16: ">i2", 32: ">i4", 64: ">i8", -32: ">f4", -64: ">f8"}
"""Types of the values by BITPIX."""

_CARD = re.compile(r"([A-Z0-9_-]{1,8}) *= *('(?:[^']|'')*'|[^/']*) *(?:/|$)")


class _DamagedError(ValueError):
    pass


class _Header:
    """The cards of a header."""

    def __init__(self, content: bytes, begin: int) -> None:
        self._values: dict[str, str] = {}
        for number in range(MOST_BLOCKS * BLOCK // CARD):
            place = begin + number * CARD
            card = content[place : place + CARD].decode("latin-1")
            if len(card) < CARD:
                raise _DamagedError("it ends within a header")
            if card.rstrip() == "END":
                self.end = place + CARD + -(place + CARD - begin) % BLOCK
                return
            if found := _CARD.match(card):
                self._values.setdefault(found[1], found[2].strip())
        raise _DamagedError(f"a header has more than {MOST_BLOCKS} blocks")

    def text(self, name: str) -> str:
        return self._values.get(name, "").strip("'").strip()

    def whole(self, name: str, default: int, most: int) -> int:
        given = self._values.get(name, str(default))
        if not re.fullmatch(r"[+-]?\d{1,18}", given) or not -64 <= int(given) <= most:
            raise _DamagedError(f"{name} is not a whole number up to {most}")
        return int(given)

    def number(self, name: str, default: float) -> float:
        try:
            return float(self._values.get(name, str(default)).replace("D", "E"))
        except ValueError:
            raise _DamagedError(f"{name} is not a number") from None


def read_fits(content: bytes, name: str, most_pixels: int) -> NDArray[np.uint16]:
    """Grey values (rows, columns) of the first image of two axes, the upper row first.

    The first row of a FITS image is the lowest one, unless its keyword ROWORDER is TOP-DOWN.
    Negative values become 0. Raises SceneError for what is no such image, or is too large.
    """
    try:
        header, shape = _first_image(content)
        rows, columns = shape
        if rows * columns > most_pixels:
            most = f"{most_pixels // 10**6} million"
            raise SceneError(f"{name} has {columns} x {rows} pixels; accepted are {most} at most")
        values = _values(content, header, rows * columns).reshape(shape)
    except _DamagedError as error:
        raise SceneError(f"{name} can not be read: {error}") from None
    if not np.all(np.isfinite(values)) or values.max(initial=0) > 0xFFFF:
        raise SceneError(f"{name} has values beyond 0 to 65535; scale it to 16 bits")
    grey = np.clip(values, 0, 0xFFFF).astype(np.uint16)
    return grey if header.text("ROWORDER") == "TOP-DOWN" else grey[::-1]


def _first_image(content: bytes) -> tuple[_Header, tuple[int, int]]:
    """Header, rows and columns of the first image of two axes."""
    place = 0
    for _ in range(MOST_UNITS):
        if place >= len(content):
            raise _DamagedError("it has no image of two axes that is not compressed")
        header = _Header(content, place)
        axes = header.whole("NAXIS", 0, 999)
        sides = [header.whole(f"NAXIS{1 + axis}", 0, 1 << 40) for axis in range(max(axes, 0))]
        if min(sides, default=0) < 0:
            raise _DamagedError("the length of an axis is negative")
        kind = header.text("XTENSION")
        if axes == 2 and kind in ("", "IMAGE") and sides[0] * sides[1] > 0:
            return header, (sides[1], sides[0])
        count = 0 if not sides else 1
        for side in sides:
            count *= side
        count += header.whole("PCOUNT", 0, 1 << 40) if kind else 0
        size = max(count, 0) * abs(header.whole("BITPIX", 8, 64)) // 8
        place = header.end + size + -size % BLOCK
    raise _DamagedError(f"its first {MOST_UNITS} units are no image of two axes")


def _values(content: bytes, header: _Header, count: int) -> NDArray[np.float32]:
    """Values (count,) as BSCALE and BZERO scale them; a float32 has all numbers up to 16 bits."""
    bits = header.whole("BITPIX", 0, 64)
    if bits not in PIXELS:
        raise _DamagedError(f"BITPIX is none of {', '.join(map(str, PIXELS))}")
    kind = np.dtype(PIXELS[bits])
    if header.end + count * kind.itemsize > len(content):
        raise _DamagedError("its values end before its last row")
    with np.errstate(over="ignore", invalid="ignore"):
        values = np.frombuffer(content, kind, count, header.end).astype(np.float32)
        values *= np.float32(header.number("BSCALE", 1.0))
        values += np.float32(header.number("BZERO", 0.0))
    return values
