"""Values of telemetry Quality for the latest picture, and why it gave no attitude.

What disturbs the picture comes first (``star_tracker.quality``); only an undisturbed picture is
said to have too few stars. The limits are chosen well above those of an undisturbed sky.
"""

from cubestack.firmware_model.cubestar.detection.contract import PictureStatistics
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.processing.identify import Results
from cubestack.firmware_model.cubestar.state import UNRATED
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.cubestar.codes import Reason
from cubestack.firmware_model.star_tracker.quality import DisturbanceLimits, Rating
from cubestack.firmware_model.star_tracker.search import MatchOutcome

#: The brightest stars fill a few pixels each, and 1e-3 are 500; brightness and differences are more
#: than noise of 4 DN feigns; a new sensor shows 20 spikes, and noise 40 more for each DN.
LIMITS = DisturbanceLimits(
    saturated=1e-3, background=40.0, background_range=5.0, spikes=60, spikes_per_dn=40
)

STREAKS = 3
ALIGNED = 0.6  #: share of all areas that are drawn out in the same way, as of a turning camera
TRACKS = 10  #: areas drawn out in directions of their own; a limb's pieces are beside a large area

_OTHERS = {
    MatchOutcome.TOO_FEW_CENTROIDS: Reason.TOO_FEW_STARS,
    MatchOutcome.TOO_FEW_MATCHED: Reason.UNCONFIRMED,
}


def reason_of(picture: PictureStatistics | None, outcome: MatchOutcome) -> Reason:
    """Why an identification ended with ``outcome``; None for a picture without statistics."""
    if picture is not None:
        smear = picture.elongated >= STREAKS and picture.aligned >= ALIGNED
        tracks = picture.elongated >= TRACKS and not picture.large
        disturbance = LIMITS.exceeded(picture, smear=smear, tracks=tracks)
        if disturbance is not None:
            return Reason[disturbance.name]
    return _OTHERS[outcome] if outcome in _OTHERS else Reason[outcome.name]


def picture_values(results: Results, reason: Reason) -> dict[str, Value]:
    """Values of a picture that gave no attitude for ``reason``."""
    values = UNRATED | {"FrameCounter": results.frame, "Reason": reason}
    picture = None if results.detection is None else results.detection.statistics
    if picture is not None:
        values |= {
            "Background": picture.background,
            "BackgroundRange": picture.background_range,
            "Noise": picture.noise,
            "Saturated": picture.saturated,
            "Spikes": picture.spikes,
            "Elongated": picture.elongated,
        }
    return values


def rated(
    results: Results, identification: Identification, rating: Rating, reason: Reason
) -> dict[str, Value]:
    """Values of a picture that gave an attitude; it is valid if ``reason`` says SOLVED."""
    valid, matched = reason is Reason.SOLVED, len(identification.matched)
    return picture_values(results, reason) | rating.values(
        matched, identification.expected, valid=valid
    )
