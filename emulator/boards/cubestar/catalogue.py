"""The star catalogue that goes into CubeStar's flash, compiled from the sky.

CubeStar thesis, section 4.3.2. The published number of pairs is that of a pair limit of 42.1
degrees; the default here is the true diagonal of the calibrated camera, distortion included, which
solves more pictures (docs/fidelity.md compares both).

The published 405 stars are 406 without alpha Centauri B, which is 0.0001 rad from A: the list
leaves out stars that close. The thesis' list must have been without it too, as its closest two
pairs are 0.0017 and 0.0067 rad apart, and table 4.3 has stars 31 and 401 as far apart as ours are
at the catalogue's epoch: with B, the stars after it would have other numbers.
"""

from functools import lru_cache

import numpy as np

from cubestack.emulator.scene.hipparcos import DEFAULT_EPOCH, load_sky
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue

MAG_LIMIT = 3.8  # chosen, as published
PAIR_LIMIT_DEG = 57.3  # chosen; the published number of pairs fixes 42.1


@lru_cache(maxsize=4)
def onboard_catalogue(
    mag_limit: float = MAG_LIMIT,
    pair_limit_deg: float = PAIR_LIMIT_DEG,
    epoch: float = DEFAULT_EPOCH,
) -> StarCatalogue:
    """Stars brighter than ``mag_limit`` (V) and their pairs, at the Julian year ``epoch``.

    Raises what ``load_sky`` and ``StarCatalogue.build`` do.
    """
    sky = load_sky(epoch, mag_limit)
    return StarCatalogue.build(
        sky.hip.astype(np.int64), sky.vectors, sky.v_mag, mag_limit, pair_limit_deg
    )
