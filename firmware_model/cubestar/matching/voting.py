"""Geometric voting: identities of centroids from the angles between them.

CubeStar thesis, section 4.3 (Algorithm 2, after Kolomenkin 2008) and section 5.3.4 (binary search,
angles computed once, preassigned arrays). For each pair of centroids the pair list is searched for
pairs of stars as far apart, and both centroids get a vote from both stars; the star with the most
votes becomes a centroid's identity; a verification round and a selection follow.

Assisted matching (section 4.3.4) votes among the stars near a rough boresight: the catalogue is cut
to 35 deg, the 5 deg by which the boresight may be wrong and 30 deg of field. Pairs with a star
outside are dropped with it; nothing else differs from lost in space.

Voting is done as printed, or by rounds. As printed, the first star with the most votes is taken,
stars within one vote of the best verified are kept, so all of them where the best has one vote or
none, and nothing is refused but fewer than three. A star without votes weighs nothing in QUEST.
What the text leaves open, or leaves to chance, is completed by rounds:

- Between the first round and the identities the voting is repeated over the same entries, and a
  vote then counts only between identities that are still standing, that is, that had a fixed part
  of the most votes anywhere in the round before. False identities back each other less and less,
  true ones go on. This decides most ties and finds the stars among many false ones.
- A centroid whose best identities still tie gets none. Three lone stars may fit two places in the
  sky, and any rule that picked one of them would be arbitrary.
- Stars whose three-dimensional order is that of the mirror image are refused.
- So few stars may agree that mere chance explains them. The number of entries that were looked
  up, the density of the catalogue and the margin give the number of such coincidences to be
  expected in a picture; above `LARGEST_CHANCE` the result is refused.
"""

from math import comb, cos, pi, radians

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.catalogue import PairList, StarCatalogue
from cubestack.firmware_model.cubestar.matching.identification import (
    NONE,
    CentroidPairs,
    Identification,
    MatchOutcome,
    unidentified,
    verify,
)
from cubestack.firmware_model.mcu.costs import Meter

#: Search tolerance of section 4.3.5, about one pixel.
DEFAULT_MARGIN_RAD = 0.001

#: Radius of the cut in assisted matching, in degrees.
CUT_RADIUS_DEG = 35.0

#: Coincidences per picture above which a result is refused; an extension, see the test of false
#: stars.
LARGEST_CHANCE = 0.05

#: Stars that a solution needs without other knowledge (section 4.3.5).
FEWEST_STARS = 3

#: Tenths of the most votes that an identity needs to stand, one for each round; assumed.
_STANDING_TENTHS = (4, 4, 5, 6, 7, 8)
_PRINTED_TENTHS = (0,)


def identify(
    directions: NDArray[np.float32],
    catalogue: StarCatalogue,
    meter: Meter,
    *,
    boresight: NDArray[np.float32] | None = None,
    margin_rad: float = DEFAULT_MARGIN_RAD,
    printed: bool = False,
) -> Identification:
    """Identify centroids of unit vectors (n, 3): lost in space, or near a `boresight` (3,).

    `margin_rad` is the largest difference between a measured and a catalogue angle; `printed` is
    Algorithm 2 as the thesis prints it. Phases:
    `reduction` (assisted only), `distances`, `votes`, `identities`, `verification`, `selection`.
    """
    listed, density = catalogue.pairs, len(catalogue) / (4 * pi)
    if boresight is not None:
        with meter.phase("reduction"):
            stars, listed = catalogue.reduced(boresight, CUT_RADIUS_DEG, meter)
        density = len(stars) / (2 * pi * (1 - cos(radians(CUT_RADIUS_DEG))))
    count = len(directions)
    if count < FEWEST_STARS:
        return unidentified(count, MatchOutcome.TOO_FEW_CENTROIDS)
    with meter.phase("distances"):
        pairs = CentroidPairs.measure(directions, meter)
    with meter.phase("votes"):
        rounds = _PRINTED_TENTHS if printed else _STANDING_TENTHS
        votes, looked_up = _vote(pairs, listed, len(catalogue), margin_rad, rounds, meter)
    with meter.phase("identities"):
        identities = _best(votes, meter, ties=printed)
    with meter.phase("verification"):
        confirmed, kept = verify(
            pairs, identities, catalogue.vectors, margin_rad, meter, thinned=not printed
        )
    with meter.phase("selection"):
        if np.count_nonzero(kept != NONE) < FEWEST_STARS:
            outcome = MatchOutcome.TOO_FEW_MATCHED
        elif printed:
            outcome = MatchOutcome.IDENTIFIED
        else:
            outcome = _judge(kept, directions, catalogue, density, looked_up, margin_rad, meter)
    if outcome is not MatchOutcome.IDENTIFIED:
        kept = np.full_like(kept, NONE)
    return Identification(kept, confirmed, outcome)


def _vote(
    pairs: CentroidPairs,
    listed: PairList,
    stars: int,
    margin_rad: float,
    rounds: tuple[int, ...],
    meter: Meter,
) -> tuple[NDArray[np.intp], int]:
    """Votes (centroids, stars) of the last round, 0 for what no longer stands; entries looked up.

    These are the entries of the pair list within the margin of each pair of centroids. A hypothesis
    is a centroid with an identity, numbered centroid x stars + star. Each entry ties two pairs of
    hypotheses together, for either centroid may be either star.
    """
    margin = np.float32(margin_rad)
    start = _search(listed.angle, pairs.angle - margin, meter)
    # The walk from the start ends at the first entry beyond the margin.
    end = np.searchsorted(listed.angle, pairs.angle + margin, side="right")
    lengths = np.maximum(end - start, 0)
    looked_up = int(lengths.sum())
    walked = looked_up + len(start)
    meter.charge(flash_read=walked, f32_compare=walked, loop=walked, f32_add=2 * len(start))
    pair = np.repeat(np.arange(len(start)), lengths)
    skipped = np.cumsum(lengths) - lengths
    entry = np.arange(looked_up) - skipped[pair] + start[pair]
    one, other = pairs.first[pair] * stars, pairs.second[pair] * stars
    star, partner = listed.first[entry], listed.second[entry]
    left = np.concatenate([one + star, one + partner])
    right = np.concatenate([other + partner, other + star])
    size = pairs.count * stars
    votes = np.ones(size, dtype=np.intp)
    for round_number, tenths in enumerate(rounds):
        first_stands = votes[left] > 0
        both = first_stands & (votes[right] > 0)
        if round_number > 0:
            tests = len(left) + int(first_stands.sum())
            meter.charge(table_byte=tests, i32_add=tests, loop=looked_up)
        votes = np.bincount(left[both], minlength=size) + np.bincount(right[both], minlength=size)
        # Two 16-bit counters a vote, the largest kept; the table is cleared word by word.
        counted = int(both.sum())
        meter.charge(
            flash_read=2 * looked_up,
            table_byte=2 * counted,
            i32_add=4 * counted,
            ram_write=2 * counted + size // 2,
            loop=size // 2,
        )
        votes[10 * votes < tenths * votes.max()] = 0
    return votes.reshape(pairs.count, stars), looked_up


def _search(
    rising: NDArray[np.float32], wanted: NDArray[np.float32], meter: Meter
) -> NDArray[np.intp]:
    """Binary search: for each wanted value the first index whose value is not below it."""
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
    meter.charge(flash_read=steps, f32_compare=steps, i32_add=3 * steps, loop=steps)
    return low


def _best(votes: NDArray[np.intp], meter: Meter, *, ties: bool) -> NDArray[np.int32]:
    """Star with the most votes for each centroid, -1 without votes; the first of several if `ties`,
    else -1."""
    meter.charge(ram_read=votes.size, i32_add=4 * votes.size, loop=votes.size)
    most = votes.max(axis=1)
    settled = ties | ((votes == most[:, None]).sum(axis=1) == 1)
    return np.where((most > 0) & settled, votes.argmax(axis=1), NONE).astype(np.int32)


def _judge(
    kept: NDArray[np.int32],
    directions: NDArray[np.float32],
    catalogue: StarCatalogue,
    stars_per_sr: float,
    looked_up: int,
    margin_rad: float,
    meter: Meter,
) -> MatchOutcome:
    """Decide whether the kept identities can be believed."""
    matched = np.flatnonzero(kept != NONE)
    if _mirrored(directions[matched], catalogue.vectors[kept[matched]], meter):
        return MatchOutcome.MIRRORED
    chance = expected_coincidences(len(kept), len(matched), looked_up, stars_per_sr, margin_rad)
    meter.charge(f32_mul=2 * len(matched) + 6, f32_div=len(matched), f32_compare=1)
    return MatchOutcome.CHANCE if chance > LARGEST_CHANCE else MatchOutcome.IDENTIFIED


def expected_coincidences(
    centroids: int, matched: int, looked_up: int, stars_per_sr: float, margin_rad: float
) -> float:
    """How many sets of so many agreeing stars chance gives in one picture.

    Each entry fixes an attitude in two ways. A further centroid then agrees when a catalogue star
    happens to lie where two rings of width 2 e cross, an area of 4 e^2 divided by the sine of the
    angle of crossing (2/pi on average). Each set is met once for each of its pairs.
    """
    hit = stars_per_sr * 2 * pi * margin_rad**2
    further = matched - 2
    return 2 * looked_up * comb(centroids - 2, further) * hit**further / comb(matched, 2)


def _mirrored(measured: NDArray[np.float32], catalogue: NDArray[np.float32], meter: Meter) -> bool:
    """Whether the triple products of measured and catalogue vectors (m, 3) have opposite signs.

    The base of all triples is the widest pair, found by the smallest cosine.
    """
    cosines = np.sum(measured[:, None, :] * measured[None, :, :], axis=2)
    a, b = np.unravel_index(int(np.argmin(cosines)), cosines.shape)
    triples = np.sum(measured * np.cross(measured[a], measured[b]), axis=1)
    catalogue_triples = np.sum(catalogue * np.cross(catalogue[a], catalogue[b]), axis=1)
    count = len(measured)
    pairs = count * (count - 1) // 2
    meter.charge(
        f32_mul=3 * pairs + 12 + 7 * count,
        f32_add=2 * pairs + 6 + 5 * count,
        f32_compare=pairs + 1,
        loop=pairs + count,
    )
    return bool(np.sum(triples * catalogue_triples) < 0)
