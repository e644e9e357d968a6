"""Sum of Gaussian spots on a sensor.

Each spot is integrated over each pixel's square, as in a detector, not sampled at its centre.
`reference` is NumPy; `spots.cpp` adds the same numbers to each pixel in the same order.
"""

import ctypes
import math

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.light.library import Library, address, light_library

Light = NDArray[np.float32]
Numbers = NDArray[np.float64]

SPOT_SIGMAS = 5.0
CELLS_AT_ONCE = 3_400_000  # limits the memory for long streaks and wide spots

REACH = 8.0
PER_SIGMA = 512
#: The normal distribution function; linear interpolation in it is accurate to 1e-7.
PHI = np.array(
    [
        0.5 * (1 + math.erf((n / PER_SIGMA - REACH) / math.sqrt(2)))
        for n in range(round(2 * REACH * PER_SIGMA) + 1)
    ]
)


def reach_px(sigma_px: float) -> int:
    """Pixels on each side of the nearest one that a spot reaches."""
    return math.ceil(SPOT_SIGMAS * sigma_px) + 1


def spots(pixels: Numbers, electrons: Numbers, sigma_px: float, shape: tuple[int, int]) -> Light:
    """Sum of spots (rows, columns) at ``pixels`` (n, 2), x first; skips NaN.

    Args:
        pixels: centres; the first pixel's is (0, 0).
        electrons: charge (n,) of each spot.
        sigma_px: their standard deviation, above 0.
        shape: rows and columns.
    """
    half = reach_px(sigma_px)
    rows, columns = shape
    with np.errstate(invalid="ignore"):
        near = np.all((pixels > -half) & (pixels < (columns - 1 + half, rows - 1 + half)), axis=1)
    found = np.ascontiguousarray(pixels[near]), np.ascontiguousarray(electrons[near])
    library = light_library()
    if library is None:
        return reference(*found, sigma_px, half, shape)
    return compiled(library, *found, sigma_px, half, shape)


def reference(
    pixels: Numbers, electrons: Numbers, sigma_px: float, half: int, shape: tuple[int, int]
) -> Light:
    """The same by NumPy, of spots that reach ``half`` px to each side and touch the sensor."""
    rows, columns = shape
    # A canvas with a margin, which contains the spots of all these stars.
    margin = 2 * half + 1
    width = columns + 2 * margin
    canvas = np.zeros((rows + 2 * margin) * width)
    cells = np.arange(-half, half + 1)
    at_once = CELLS_AT_ONCE // len(cells) ** 2
    for first in range(0, len(pixels), at_once):
        some = slice(first, first + at_once)
        nearest = np.rint(pixels[some]).astype(np.int64)
        shares = _shares(pixels[some] - nearest, half, sigma_px)
        shares[:, 1] *= electrons[some, None]
        values = shares[:, 1, :, None] * shares[:, 0, None, :]
        starts = (nearest[:, 1, None] + margin + cells) * width
        index = starts[:, :, None] + (nearest[:, 0, None] + margin + cells)[:, None, :]
        np.add.at(canvas, index.ravel(), values.ravel())
    image = canvas.reshape(-1, width)[margin:-margin, margin:-margin]
    return image.astype(np.float32)


def compiled(
    library: Library,
    pixels: Numbers,
    electrons: Numbers,
    sigma_px: float,
    half: int,
    shape: tuple[int, int],
) -> Light:
    """The same by the compiled library."""
    rows, columns = shape
    image = np.empty(shape, np.float32)
    library.light_spots(
        address(pixels),
        address(electrons),
        len(pixels),
        ctypes.c_double(sigma_px),
        half,
        address(PHI),
        rows,
        columns,
        address(image),
    )
    return image


def _shares(offsets: Numbers, half: int, sigma_px: float) -> Numbers:
    """Share of each spot in the columns and rows around it: (n, 2) to (n, 2, 2 * half + 1)."""
    edges = np.arange(-half, half + 2) - 0.5
    place = ((edges - offsets[:, :, None]) / sigma_px + REACH) * PER_SIGMA
    place = np.clip(place, 0, len(PHI) - 1)
    piece = np.minimum(place.astype(np.int64), len(PHI) - 2)
    level = PHI[piece]
    return np.diff(level + (place - piece) * (PHI[piece + 1] - level), axis=-1)
