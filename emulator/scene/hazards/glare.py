"""Light that a lens scatters around a bright source in its field.

Assumed: a hundredth of the light is scattered, like the veiling glare of clean multi-element lenses
(ISO 9358 measures 1 to 3 % for usual ones), and its surface brightness decreases with the square of
the angle, like the aureole of stars (King 1971, PASP 83, 199), from the angle of the Moon's limb to
45 degrees.
"""

import math

import numpy as np
from numpy.typing import NDArray

SHARE = 0.01
INNER_RAD, OUTER_RAD = math.radians(0.26), math.radians(45.0)


def aureole(angles_rad: NDArray[np.float64], share: float = SHARE) -> NDArray[np.float64]:
    """Scattered brightness (n,) per steradian at these angles (n,) from a source of brightness 1.

    ``share`` of its light is scattered. Within the inner angle the brightness is constant.
    """
    scale = share / (2 * math.pi * math.log(OUTER_RAD / INNER_RAD))
    falling = scale / np.maximum(angles_rad, INNER_RAD) ** 2
    return np.asarray(np.where(angles_rad < OUTER_RAD, falling, 0.0))
