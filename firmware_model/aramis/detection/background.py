"""The threshold between sky and stars, from the last five pictures.

AraMiS thesis, section 3.5: their mean grey level plus twice the noise. The noise is the standard
deviation over the same pixels (the thesis does not define it); stars cover too few pixels to
matter.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.mcu.costs import Meter

FRAMES = 5


class LevelHistory:
    """Grey levels of the last pictures; what the program keeps from one picture to the next.

    Attributes:
        sums: (pixels, sum, sum of squares) of each picture, the newest last. The Blackfin's 40-bit
            accumulator holds the squares of 1280 x 1024 pixels.
    """

    def __init__(self) -> None:
        self.sums: deque[tuple[int, int, int]] = deque(maxlen=FRAMES)

    def add(self, picture: NDArray[np.uint8], field: CameraField, meter: Meter) -> None:
        """Count a picture (rows, columns), without the pixels outside the field."""
        levels = np.bincount(picture[field.mask], minlength=256).astype(np.int64)
        values, pixels = np.arange(256), field.pixels
        self.sums.append((pixels, int(levels @ values), int(levels @ values**2)))
        meter.charge(pixel_read=pixels, i32_add=2 * pixels, i32_mul=pixels, loop=pixels)

    def mean(self, meter: Meter) -> int:
        """Mean level, rounded; 0 without a picture."""
        pixels, total, _ = self._totals()
        meter.charge(i32_add=FRAMES, i32_div=1)
        return (total + pixels // 2) // pixels if pixels else 0

    def threshold(self, sigmas: float, meter: Meter) -> int:
        """Level above which a pixel is a star's: mean plus ``sigmas`` standard deviations."""
        pixels, total, squares = self._totals()
        # The two products have 62 bits, of four 32-bit ones each.
        meter.charge(i32_add=3 * FRAMES + 8, i32_mul=8, f32_convert=3, f32_div=2, f32_sqrt=1)
        meter.charge(f32_mul=1, f32_add=1, loop=FRAMES)
        if not pixels:
            return 0
        count = np.float32(pixels)
        deviation = np.sqrt(np.float32(squares * pixels - total * total)) / count
        return int(np.float32(total) / count + np.float32(sigmas) * deviation)

    def _totals(self) -> tuple[int, int, int]:
        pixels, total, squares = map(sum, zip(*self.sums, (0, 0, 0), strict=True))
        return pixels, total, squares
