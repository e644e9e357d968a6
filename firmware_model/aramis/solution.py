"""Settings, stars and outcome of an identification.

AraMiS thesis, sections 5.7 (the three outcomes), 5.9 (rough direction) and appendix E.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason
from cubestack.firmware_model.star_tracker.quality import Rating, SkyStatistics
from cubestack.firmware_model.values import DeclaredValues, choice, flag, number, whole

NONE = -1  #: mark of a measured star without identity


@dataclass(frozen=True)
class Profile(DeclaredValues):
    """Settings of the identification; the defaults are the published ones.

    ``within_ms`` is 650 ms because a second also holds the longest wait for a frame, 233 ms, and
    the catalogue's check. Stars that moved farther than ``moved_px`` may also just be drawn so by
    the lens, so ``motion_sigma_rad`` decides about them.
    """

    sigma_rad: float = number(
        0.26 * 0.3759 / 582,  # chosen by appendix E: 0.26 px of the thesis' simulator
        "noise of a measured direction per axis",
        1e-7,
        1e-2,
    )
    pivots: int = whole(3, "pivot triangles at most", 0, 3)
    always_pivot: bool = flag(
        False, "measure a pivot triangle even when one candidate is left, as appendix E does"
    )
    filtered: bool = flag(
        True,
        "a unique triangle near a rough direction must also have the right sides and a boresight "
        "near it (an extension)",
    )
    identities: Literal["section-5.8", "appendix-e", "either"] = choice(
        "either",
        "separation of stars; either: where the sides are checked, by section 5.8's criteria",
        ("section-5.8", "appendix-e", "either"),
    )
    by_variance: bool = flag(
        False, "section 5.8's criteria score the variance over the mean, as its text says"
    )
    verify: bool = flag(
        False, "an attitude must be confirmed by further stars; what follows is only then"
    )
    tolerance_rad: float = number(
        1.2e-3, "distance within which a star speaks for an attitude at first", 1e-5, 0.05
    )
    side_tolerance_rad: float = number(
        7e-4,  # three sigma of a difference of two stars' places
        "largest difference of a side near a rough direction",
        1e-6,
        0.05,
    )
    largest_chance: float = number(
        1e-5, "believed wrong attitudes per picture, at most, that would be confirmed as well", 0, 1
    )
    largest_sigma_rad: float = number(
        1.65e-3, "largest standard deviation of the turn about the boresight", 0, 1
    )
    within_ms: float = number(650.0, "processor time from the picture until it gives up", 1, 10_000)
    hint_tolerance_deg: float = number(
        6.0, "with a rough direction, a boresight farther from it is refused", 0, 180
    )
    smear_px: float = number(4.0, "stars that are drawn out farther moved", 1, 1000)
    moved_px: float = number(
        1.8,
        "stars that moved farther from row to row are refused where the turn about the boresight "
        "is too uncertain",
        0,
        1000,
    )
    judge_lens: bool = flag(True, "stars beside their places judge the lens")
    motion_sigma_rad: float = number(7e-4, "uncertainty that is too much then", 0, 0.1)


@dataclass(frozen=True)
class PictureLight(SkyStatistics):
    """Light of a picture beside stars, in counts."""

    threshold: float  #: median level of a bright pixel
    widest: int  #: pixels of the largest bright region
    rejected: int  #: regions whose shape no star has


@dataclass(frozen=True, eq=False)
class StarList:
    """Stars of a picture, the brightest first."""

    centroids: Floats  #: (n, 2) x and y in px, float32
    brightness: Floats  #: (n,) sum of grey levels, falling, float32
    smear_px: float = 0.0  #: length of the streaks that motion made of them
    skew_px: float = 0.0  #: how far they moved while the rows were exposed one after the other
    #: (n,) expected errors of the centroids, each axis; None: the profile's
    sigma_px: Floats | None = None
    #: what the picture has beside them; None with a threshold for the whole picture
    light: PictureLight | None = None

    def __len__(self) -> int:
        return len(self.centroids)


@dataclass(frozen=True, eq=False)
class Solution:
    """Outcome of one picture."""

    outcome: MeasurementOutcome  #: conclusive, ambiguous or none
    reason: Reason  #: why
    #: (4,) inertial to camera, scalar last and not negative; None unless conclusive
    quaternion: Floats | None
    #: (n,) index into the database's star list for each measured star, -1 for none
    stars: NDArray[np.int32]
    measured: StarList  #: the stars that were found
    #: of the last triple: triangles left, and pivot triangles used
    candidates: int = 0
    pivots: int = 0
    triples: int = 0  #: tried
    expected: int = 0  #: catalogue stars in the field by the attitude, 0 without verification
    rating: Rating | None = None  #: of a confirmed attitude


def unsolved(reason: Reason, measured: StarList, **counts: int) -> Solution:
    nothing = np.full(len(measured), NONE, dtype=np.int32)
    return Solution(MeasurementOutcome.NONE, reason, None, nothing, measured, rating=None, **counts)
