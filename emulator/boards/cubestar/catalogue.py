"""The star catalogue in CubeStar's flash, compiled from the sky.

CubeStar thesis, section 4.3.2. A pair limit of 42.1 degrees gives 11 483 pairs, one less than
section 5.3.2 has; the default here is the true diagonal of the calibrated camera, including
distortion, which solves more images (docs/fidelity.md compares both).

The published 405 stars are the 406 of Hipparcos without alpha Centauri B, which is 0.0001 rad from
A: the list omits stars that close. The thesis' list must omit it too: its closest two pairs are
0.0017 and 0.0067 rad apart, and in table 4.3 stars 31 and 401 have the same distance as ours at the
catalogue's epoch, whereas with B the later stars would have other numbers.
"""

from functools import lru_cache

import numpy as np

from cubestack.emulator.scene.hipparcos import DEFAULT_EPOCH, load_sky
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue

MAG_LIMIT = 3.8  # chosen, as published
PAIR_LIMIT_DEG = 57.3  # chosen; the published number of pairs fixes 42.101


@lru_cache(maxsize=4)
def onboard_catalogue(
    mag_limit: float = MAG_LIMIT,
    pair_limit_deg: float = PAIR_LIMIT_DEG,
    epoch: float = DEFAULT_EPOCH,
) -> StarCatalogue:
    """Stars up to magnitude ``mag_limit`` (V) and their pairs, at the Julian year ``epoch``."""
    sky = load_sky(epoch, mag_limit)
    return StarCatalogue.build(
        sky.hip.astype(np.int64), sky.vectors, sky.v_mag, mag_limit, pair_limit_deg
    )
