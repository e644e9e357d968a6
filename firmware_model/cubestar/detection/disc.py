"""The Moon's disc in an image, by its size and brightness.

Its light and the glare around it saturate a round area that is larger than any star's, even where
only a twentieth of it is lit.
"""

from dataclasses import dataclass

import numpy as np

from cubestack.firmware_model.cubestar.image_memory import ImageMemory
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Routine

STEP = 4  #: of the samples, px
SATURATED_DN = 250

#: Saturated samples of the Moon from a twentieth lit on; a star has fewer, as it saturates up to
#: seven pixels. Chosen.
FEWEST_SAMPLES = 3

LARGEST_PX = 45  #: radius of the full Moon's saturated glare, with some room


@dataclass(frozen=True)
class SeenDisc:
    """The Moon's disc with its glare in the image, as sampled."""

    samples: int  #: saturated ones
    #: middle in px
    x: float
    y: float

    @property
    def radius_px(self) -> float:
        return float(np.sqrt(self.samples * STEP**2 / np.pi))

    @property
    def is_whole(self) -> bool:
        """Whether all of it is in the image, so that its middle is the Moon's."""
        return is_inside(self.x, self.y, self.radius_px + STEP)


def find_disc(memory: ImageMemory, meter: Meter) -> Routine[SeenDisc | None]:
    """The Moon's disc by its size and brightness: saturated pixels close together, more than any
    star has."""
    y, x = np.mgrid[STEP // 2 : ROWS : STEP, STEP // 2 : COLUMNS : STEP].reshape(2, -1)
    values = yield from memory.sample((y * COLUMNS + x).astype(np.int32))
    bright = values >= SATURATED_DN
    meter.charge(i32_add=len(values), loop=len(values))
    x, y = x[bright], y[bright]
    # Two passes: the median leaves single saturated stars aside.
    meter.charge(i32_add=8 * len(x), f32_convert=2, f32_div=2, loop=2 * len(x))
    if len(x) < FEWEST_SAMPLES:
        return None
    near = np.hypot(x - np.median(x), y - np.median(y)) <= LARGEST_PX
    if np.count_nonzero(near) < max(FEWEST_SAMPLES, 0.8 * len(x)):
        return None
    return SeenDisc(int(np.count_nonzero(near)), float(x[near].mean()), float(y[near].mean()))


def is_inside(x: float, y: float, radius_px: float = LARGEST_PX) -> bool:
    """Whether all of a disc with its middle at ``x`` and ``y`` is in the image."""
    return bool(radius_px <= x < COLUMNS - radius_px and radius_px <= y < ROWS - radius_px)
