"""What goes into an identification and what comes out: settings, stars, outcome.

AraMiS thesis, sections 5.7 (the three outcomes), 5.9 (rough direction) and appendix E.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.aramis.bounds import check_bounds
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason

NONE = -1
"""Mark of a measured star without identity."""


@dataclass(frozen=True)
class Profile:
    """Settings of the identification; the defaults are the published ones.

    Attributes:
        sigma_rad: noise of a measured direction per axis, in rad. The thesis' appendix E settles on
            0.26 px of its simulator, 0.3759 rad / 582.
        pivots: pivot triangles at most, 0 to 3.
        always_pivot: whether one is measured even when one candidate is left, as appendix E does.
        filtered: whether a unique triangle near a rough direction must also have the right sides
            and a boresight near it (an extension).
        identities: how stars are told apart: by section 5.8 or appendix E, or either criterion of
            section 5.8 where the sides are checked.
        hint_tolerance_deg: with a rough direction, a boresight farther from it is refused (an
            extension).
        side_tolerance_rad: largest difference of a side, with verification or a rough direction;
            three sigma of a difference of two stars' places by default.
        verify: whether an attitude must be confirmed by further stars; what follows is only then.
        tolerance_rad: distance within which a star confirms.
        largest_chance: an attitude is confirmed when chance would do it less often.
        spread_rad: stars that confirm are at least so far from their middle, root mean square.
        triples, triple_stars: triples tried at most, and of how many of the brightest stars.
        candidates: of a triple, tried at most; pivots only serve to leave no more.
        smear_px: where stars are drawn out farther, that is why there is no attitude.
        skew_px: stars that also moved farther from row to row are refused.
        moved_px: stars that moved farther from row to row are also refused when they leave too much
            doubt about the turn about the boresight; below it, stars that look long may just be
            drawn so by the lens.
        motion_sigma_rad: that much doubt.
    """

    sigma_rad: float = 0.26 * 0.3759 / 582  # chosen by appendix E
    pivots: int = 3
    always_pivot: bool = False
    filtered: bool = True
    identities: Literal["section-5.8", "appendix-e", "either"] = "either"
    verify: bool = False
    tolerance_rad: float = 1.2e-3
    side_tolerance_rad: float = 7e-4
    largest_chance: float = 1e-4
    spread_rad: float = 0.03
    triples: int = 120
    triple_stars: int = 10
    candidates: int = 40
    hint_tolerance_deg: float = 6.0
    smear_px: float = 4.0
    skew_px: float = 4.0
    moved_px: float = 1.8
    motion_sigma_rad: float = 7e-4

    def __post_init__(self) -> None:
        """Refuse settings with which nothing can be found."""
        check_bounds(
            self,
            sigma_rad=(1e-7, 1e-2),
            pivots=(0, 3),
            tolerance_rad=(1e-5, 0.05),
            side_tolerance_rad=(1e-6, 0.05),
            largest_chance=(0, 1),
            spread_rad=(0, 1),
            triples=(1, 1000),
            triple_stars=(3, 64),
            candidates=(1, 1000),
            hint_tolerance_deg=(0, 180),
            smear_px=(1, 1000),
            skew_px=(0, 1000),
            moved_px=(0, 1000),
            motion_sigma_rad=(0, 0.1),
        )


@dataclass(frozen=True, eq=False)
class StarList:
    """Stars of a picture, the brightest first.

    Attributes:
        centroids: (n, 2) x and y in px, float32.
        brightness: (n,) sum of grey levels, falling, float32.
        smear_px: length of the streaks that motion made of them.
        skew_px: how far they moved while the rows were exposed one after the other.
    """

    centroids: Floats
    brightness: Floats
    smear_px: float = 0.0
    skew_px: float = 0.0

    def __len__(self) -> int:
        """Number of stars."""
        return len(self.centroids)


@dataclass(frozen=True, eq=False)
class Solution:
    """What became of one picture.

    Attributes:
        outcome: conclusive, ambiguous or none.
        reason: why.
        quaternion: (4,) inertial to camera, scalar last and not negative; None unless conclusive.
        stars: (n,) index into the database's star list for each measured star, -1 for none.
        measured: the stars that were found.
        candidates, pivots: of the last triple: triangles left, and pivot triangles used.
        triples: tried.
        expected: catalogue stars in the field by the attitude, 0 without verification.
    """

    outcome: MeasurementOutcome
    reason: Reason
    quaternion: Floats | None
    stars: NDArray[np.int32]
    measured: StarList
    candidates: int = 0
    pivots: int = 0
    triples: int = 0
    expected: int = 0


def unsolved(reason: Reason, measured: StarList, **counts: int) -> Solution:
    """A solution without attitude."""
    nothing = np.full(len(measured), NONE, dtype=np.int32)
    return Solution(MeasurementOutcome.NONE, reason, None, nothing, measured, **counts)
