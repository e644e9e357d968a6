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
        side_tolerance_rad: largest difference of a side near a rough direction; three sigma of a
            difference of two stars' places by default.
        verify: whether an attitude must be confirmed by further stars; what follows is only then.
        tolerance_rad: distance within which a star speaks for an attitude at first.
        largest_chance: an attitude is believed when so many wrong ones, at most, would be confirmed
            as well in a picture.
        largest_sigma_rad: an attitude is refused whose turn about the boresight has a larger
            standard deviation.
        within_ms: of processor time from the picture on; then identification is given up. Beside
            it a second holds the longest wait for a frame, 233 ms, and the catalogue's check.
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
    largest_chance: float = 1e-5
    largest_sigma_rad: float = 1.5e-3
    within_ms: float = 650.0
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
            largest_sigma_rad=(0, 1),
            within_ms=(1, 10_000),
            hint_tolerance_deg=(0, 180),
            smear_px=(1, 1000),
            skew_px=(0, 1000),
            moved_px=(0, 1000),
            motion_sigma_rad=(0, 0.1),
        )


@dataclass(frozen=True)
class Light:
    """What a picture has beside stars.

    Attributes:
        level, threshold: of the sky, and of a bright pixel; medians over the field, in counts.
        noise: standard deviation of a pixel.
        spread: of the level over the field.
        blind: share of the field that is too bright for stars, 0 to 1.
        widest: pixels of the largest bright region.
        spikes: pixels far above their surroundings that are too few to be a star.
        rejected: regions whose shape no star has.
    """

    level: float
    threshold: float
    noise: float
    spread: float
    blind: float
    widest: int
    spikes: int
    rejected: int


@dataclass(frozen=True, eq=False)
class StarList:
    """Stars of a picture, the brightest first.

    Attributes:
        centroids: (n, 2) x and y in px, float32.
        brightness: (n,) sum of grey levels, falling, float32.
        smear_px: length of the streaks that motion made of them.
        skew_px: how far they moved while the rows were exposed one after the other.
        sigma_px: (n,) expected errors of the centroids, each axis; None: the profile's.
        light: what the picture has beside them; None with a threshold for the whole picture.
    """

    centroids: Floats
    brightness: Floats
    smear_px: float = 0.0
    skew_px: float = 0.0
    sigma_px: Floats | None = None
    light: Light | None = None

    def __len__(self) -> int:
        """Number of stars."""
        return len(self.centroids)


@dataclass(frozen=True, eq=False)
class Quality:
    """What a confirmed attitude is worth.

    Attributes:
        covariance: (3, 3) of small turns about the camera's axes, in rad squared.
        residual_rad: root mean square of its stars' residuals in each axis.
        false_alarm: wrong attitudes to be expected that would be confirmed as well.
        scale: focal length that the stars show, beside the one that is set.
    """

    covariance: Floats
    residual_rad: float
    false_alarm: float
    scale: float

    @property
    def sigma_rad(self) -> Floats:
        """(3,) standard deviations about the camera's axes."""
        sigma: Floats = np.sqrt(np.diagonal(self.covariance)).astype(np.float32)
        return sigma


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
        quality: of a confirmed attitude.
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
    quality: Quality | None = None


def unsolved(reason: Reason, measured: StarList, **counts: int) -> Solution:
    """A solution without attitude."""
    nothing = np.full(len(measured), NONE, dtype=np.int32)
    return Solution(
        MeasurementOutcome.NONE, reason, None, nothing, measured, quality=None, **counts
    )
