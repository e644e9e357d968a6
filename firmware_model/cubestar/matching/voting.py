"""Geometric voting: identities of centroids from the angles between them.

CubeStar thesis, section 4.3 (Algorithm 2, after Kolomenkin 2008) and section 5.3.4 (binary search,
angles computed once, preassigned arrays). For each pair of centroids the pair list is searched for
pairs of stars as far apart, and both centroids get a vote from both stars. The star with the most
votes becomes a centroid's identity; a verification round and a selection follow.

Assisted matching (section 4.3.4) votes among the stars near a rough boresight: the catalogue is cut
to 35 deg, 5 deg of error and 30 deg of field. Pairs with a star outside are dropped.

Where the text is open it is taken literally: the first star with the most votes is taken; stars
within one vote of the best are kept, so all where that is one or none; only fewer than three are
refused. A star without votes has no weight in QUEST.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.catalogue import PairList, StarCatalogue
from cubestack.firmware_model.cubestar.matching.identification import (
    NONE,
    CentroidPairs,
    Identification,
    unidentified,
    verify,
)
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.inner_loops import FLOAT, FLOATS, INT, INTS, NAMES, Loop
from cubestack.firmware_model.star_tracker.search import MatchOutcome

_VOTE = Loop(
    "voting_vote",
    *(FLOATS, NAMES, NAMES, INT),
    *(FLOATS, INTS, INTS, INT),
    *(FLOAT, INT, INTS, INTS),
)

#: Search tolerance of section 4.3.5, about one pixel.
DEFAULT_MARGIN_RAD = 0.001

#: Radius of the cut in assisted matching, in degrees.
CUT_RADIUS_DEG = 35.0

#: Stars that a solution needs without other knowledge (section 4.3.5).
FEWEST_STARS = 3


def identify(
    directions: NDArray[np.float32],
    catalogue: StarCatalogue,
    meter: Meter,
    *,
    boresight: NDArray[np.float32] | None = None,
    margin_rad: float = DEFAULT_MARGIN_RAD,
) -> Identification:
    """Identify centroids of unit vectors (n, 3): lost in space, or near a `boresight` (3,).

    `margin_rad` is the largest difference between a measured and a catalogue angle. Phases:
    `reduction` (assisted only), `distances`, `votes`, `identities`, `verification`, `selection`.
    """
    listed = catalogue.pairs
    if boresight is not None:
        with meter.phase("reduction"):
            _, listed = catalogue.reduced(boresight, CUT_RADIUS_DEG, meter)
    count = len(directions)
    if count < FEWEST_STARS:
        return unidentified(count, MatchOutcome.TOO_FEW_CENTROIDS)
    with meter.phase("distances"):
        pairs = CentroidPairs.measure(directions, meter)
    with meter.phase("votes"):
        votes = _vote(pairs, listed, len(catalogue), margin_rad, meter)
    with meter.phase("identities"):
        identities = _best(votes, meter)
    with meter.phase("verification"):
        confirmed, kept = verify(
            pairs, identities, catalogue.vectors, margin_rad, meter, thinned=False
        )
    with meter.phase("selection"):
        if np.count_nonzero(kept != NONE) < FEWEST_STARS:
            return Identification(np.full_like(kept, NONE), confirmed, MatchOutcome.TOO_FEW_MATCHED)
    return Identification(kept, confirmed, MatchOutcome.IDENTIFIED)


def _vote(
    pairs: CentroidPairs, listed: PairList, stars: int, margin_rad: float, meter: Meter
) -> NDArray[np.intp]:
    """Votes (centroids, stars) of the entries of the pair list within the margin of each pair;
    either centroid may be either star."""
    votes, looked_up, steps = (_counted_compiled if _VOTE else _counted)(
        pairs, listed, stars, margin_rad
    )
    meter.charge(flash_read=steps, f32_compare=steps, i32_add=3 * steps, loop=steps)
    walked = looked_up + len(pairs.angle)
    meter.charge(flash_read=walked, f32_compare=walked, loop=walked, f32_add=2 * len(pairs.angle))
    # Two 16-bit counters a vote; the table is cleared word by word.
    counted, words = 2 * looked_up, votes.size // 2
    meter.charge(
        flash_read=2 * looked_up,
        table_byte=2 * counted,
        i32_add=4 * counted,
        ram_write=2 * counted + words,
        loop=words,
    )
    return votes


def _counted(
    pairs: CentroidPairs, listed: PairList, stars: int, margin_rad: float
) -> tuple[NDArray[np.intp], int, int]:
    """Votes, entries looked up, and steps of the binary searches."""
    margin = np.float32(margin_rad)
    start, steps = _search(listed.angle, pairs.angle - margin)
    # The walk from the start ends at the first entry beyond the margin.
    end = np.searchsorted(listed.angle, pairs.angle + margin, side="right")
    lengths = np.maximum(end - start, 0)
    looked_up = int(lengths.sum())
    pair = np.repeat(np.arange(len(start)), lengths)
    skipped = np.cumsum(lengths) - lengths
    entry = np.arange(looked_up) - skipped[pair] + start[pair]
    one, other = pairs.first[pair] * stars, pairs.second[pair] * stars
    star, partner = listed.first[entry], listed.second[entry]
    left = np.concatenate([one + star, one + partner])
    right = np.concatenate([other + partner, other + star])
    size = pairs.count * stars
    votes = np.bincount(left, minlength=size) + np.bincount(right, minlength=size)
    return votes.reshape(pairs.count, stars), looked_up, steps


def _counted_compiled(
    pairs: CentroidPairs, listed: PairList, stars: int, margin_rad: float
) -> tuple[NDArray[np.intp], int, int]:
    votes, steps = np.zeros((pairs.count, stars), np.intp), np.zeros(1, np.int64)
    entries = (*(np.ascontiguousarray(e) for e in (listed.angle, listed.first, listed.second)),)
    wanted = pairs.angle, pairs.first, pairs.second, len(pairs.angle)
    looked_up = _VOTE(*entries, len(listed), *wanted, margin_rad, stars, votes, steps)
    return votes, looked_up, int(steps[0])


def _search(
    rising: NDArray[np.float32], wanted: NDArray[np.float32]
) -> tuple[NDArray[np.intp], int]:
    """Binary search: for each wanted value the first index whose value is not below it; steps."""
    low = np.zeros(len(wanted), dtype=np.intp)
    high = np.full(len(wanted), len(rising), dtype=np.intp)
    steps = 0
    while np.any(open_ := low < high):
        steps += int(open_.sum())
        middle = (low + high) // 2
        below = np.zeros(len(wanted), dtype=bool)
        below[open_] = rising[middle[open_]] < wanted[open_]
        low = np.where(open_ & below, middle + 1, low)
        high = np.where(open_ & ~below, middle, high)
    return low, steps


def _best(votes: NDArray[np.intp], meter: Meter) -> NDArray[np.int32]:
    """First star with the most votes for each centroid, -1 without votes."""
    meter.charge(ram_read=votes.size, i32_add=4 * votes.size, loop=votes.size)
    most = votes.max(axis=1)
    return np.where(most > 0, votes.argmax(axis=1), NONE).astype(np.int32)
