"""Which named stars of an image agree with each other: the check that several methods share."""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.database import angles
from cubestack.host.studies.compare.tracker import NONE, Indices

FEWEST = 4
"""Stars that agree pairwise in an answer: of three alone, chance finds too many (chosen)."""


def agreeing(
    names: Indices,
    measured: NDArray[np.float64],
    vectors: NDArray[np.float64],
    margin: float,
    meter: Meter,
) -> Indices:
    """The names (n,) without those that contradict others.

    Whoever agrees with the fewest others leaves, until all of the rest agree pairwise.

    Args:
        names: star in the list, or ``NONE``.
        measured: (n, n) measured angles in rad.
        vectors: of the star list.
    """
    named = np.flatnonzero(names != NONE)
    stars = names[named]
    listed = angles(vectors[stars][:, None], vectors[stars][None])
    agree = np.abs(listed - measured[np.ix_(named, named)]) <= margin
    agree &= stars[:, None] != stars
    checked = len(named) * (len(named) - 1) // 2
    # Cosines of both are compared, within the margin times the measured angle's sine.
    meter.charge(f32_mul=7 * checked, f32_add=5 * checked, f32_compare=checked, loop=checked)
    meter.charge(flash_read=3 * len(named), ram_read=6 * checked)
    kept = np.ones(len(named), bool)
    while kept.any():
        members = np.flatnonzero(kept)
        count = agree[np.ix_(members, members)].sum(axis=1)
        meter.charge(table_byte=len(members) ** 2, i32_add=len(members) ** 2)
        if count.min() == len(members) - 1:
            break
        kept[members[np.argmin(count)]] = False
    found = np.full(len(names), NONE)
    found[named[kept]] = stars[kept]
    return found
