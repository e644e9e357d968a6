"""Areas of an image that detection ignores, such as a boom in the field of view.

Telecommands Mask1 and Mask2 of the node protocol; the areas' effect is assumed.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter


class Mask(NamedTuple):
    """One area in px, ends included; all 0 is no area."""

    x_min: int = 0
    x_max: int = 0
    y_min: int = 0
    y_max: int = 0


def masked(
    x: NDArray[np.int64], y: NDArray[np.int64], masks: Sequence[Mask], meter: Meter
) -> NDArray[np.bool_]:
    """Mask of the pixels (n,) in an area; charges four comparisons per pixel and area."""
    inside = np.zeros(len(x), dtype=bool)
    used = [mask for mask in masks if any(mask)]
    for mask in used:
        inside |= (mask.x_min <= x) & (x <= mask.x_max) & (mask.y_min <= y) & (y <= mask.y_max)
    meter.charge(i16_add=4 * len(x) * len(used), i8=len(masks))
    return inside
