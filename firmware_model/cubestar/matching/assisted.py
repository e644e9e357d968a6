"""Assisted matching: geometric voting among the stars near a rough boresight.

CubeStar thesis, section 4.3.4. The catalogue is cut to 35 deg, the 5 deg by which the rough
boresight may be wrong and 30 deg of field; pairs with a star outside are dropped with it. Nothing
else differs from lost in space.
"""

from math import cos, pi, radians

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.matching.voting import DEFAULT_MARGIN_RAD, identify_among
from cubestack.firmware_model.mcu.costs import Meter

#: Radius of the cut in degrees.
CUT_RADIUS_DEG = 35.0


def identify_assisted(
    directions: NDArray[np.float32],
    catalogue: StarCatalogue,
    boresight: NDArray[np.float32],
    meter: Meter,
    *,
    margin_rad: float = DEFAULT_MARGIN_RAD,
    radius_deg: float = CUT_RADIUS_DEG,
) -> Identification:
    """Identify centroids of unit vectors (n, 3) within ``radius_deg`` of a known direction.

    ``boresight`` (3,) is a unit vector in inertial axes, ``margin_rad`` the largest difference
    between a measured and a catalogue angle. Phases: `reduction` and those of `voting.identify`.
    """
    with meter.phase("reduction"):
        reduced = catalogue.reduced(boresight, radius_deg, meter)
    cap_sr = 2 * pi * (1 - cos(radians(radius_deg)))
    return identify_among(
        directions,
        catalogue.vectors,
        reduced.pairs,
        len(reduced.stars) / cap_sr,
        meter,
        margin_rad=margin_rad,
    )
