"""What a downloaded frame holds: pixels of the picture, or nothing.

CubeSpace family with two cameras, interface generation 2, downloads squares of five sizes; how a
640 x 480 picture becomes one is assumed. The picture lies in the middle of a square of 1024 x 1024
pixels, 192 columns from its left and 272 rows from its top, and the rest is zero. A smaller square
takes every 2nd, 4th, 8th or 16th pixel of every such row of the large one, from its first pixel on.
The margins are multiples of 16, so every square takes the picture's first pixel, and so on from
there: a thumbnail is a sub-sampled picture. Nothing is averaged, because the processor has neither
the memory nor the time.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.cubesense.codes import COLUMNS, FRAME_BYTES, ROWS, ImageSize

#: Number of a pixel that lies outside of the picture.
OUTSIDE = -1


def frame_pixels(size: ImageSize, frame: int) -> NDArray[np.int32]:
    """Where the 128 bytes of a frame come from, int32 (128,).

    Each is a pixel's number in the picture, row after row from 0 to 307199, or ``OUTSIDE`` for a
    byte that is zero. The pixels' numbers ascend within a frame and from frame to frame, so a
    picture that can only be read in sequence is read once. Raises ValueError for a frame that
    ``size`` lacks.
    """
    if not 0 <= frame < size.frames:
        raise ValueError(f"{size.name} has frames 0 to {size.frames - 1}, not {frame}")
    position = frame * FRAME_BYTES + np.arange(FRAME_BYTES)
    row = (position // size.side - size.top) * size.step
    column = (position % size.side - size.left) * size.step
    inside = (row >= 0) & (row < ROWS) & (column >= 0) & (column < COLUMNS)
    return np.where(inside, row * COLUMNS + column, OUTSIDE).astype(np.int32)
