"""Why a picture gave no attitude, as far as the picture itself shows it.

What the search for stars measured speaks first, for that is the cause and the failure its effect:
a bright sky, a picture at the end of its scale, spikes, streaks. Only an undisturbed picture is
said to have too few stars. The limits are chosen well above those of an undisturbed sky.
"""

from cubestack.firmware_model.cubestar.detection.contract import PictureStatistics
from cubestack.firmware_model.interface.cubestar.codes import Reason
from cubestack.firmware_model.star_tracker.search import MatchOutcome

SATURATED_SHARE = 1e-3
"""Of the picture at the end of its scale, about 500 pixels: the brightest stars fill a few each."""

STRAY_RANGE_DN = 5.0
STRAY_BACKGROUND_DN = 40.0
"""Brightness of the sky, and its differences: more than noise of 4 DN feigns."""

MANY_SPIKES = 60
SPIKES_BY_NOISE = 40
"""Pixels sharper than a spot: a new sensor shows 20, and noise so many for each DN."""

STREAKS = 3
ALIGNED = 0.6
"""Share of all areas that are drawn out in the same way: stars of a turning camera are."""

TRACKS = 10
"""Areas drawn out in directions of their own; pieces of a limb are, too, beside a large area."""

_OUTCOMES = {
    MatchOutcome.TOO_FEW_CENTROIDS: Reason.TOO_FEW_STARS,
    MatchOutcome.TOO_FEW_MATCHED: Reason.UNCONFIRMED,
    MatchOutcome.MIRRORED: Reason.MIRRORED,
    MatchOutcome.UNCONFIRMED: Reason.UNCONFIRMED,
    MatchOutcome.AMBIGUOUS: Reason.AMBIGUOUS,
    MatchOutcome.NO_TIME: Reason.NO_TIME,
}


def reason_of(picture: PictureStatistics | None, outcome: MatchOutcome) -> Reason:
    """Why an identification ended with ``outcome``; None for a picture without statistics."""
    disturbed = None if picture is None else _disturbance(picture)
    return _OUTCOMES[outcome] if disturbed is None else disturbed


def _disturbance(picture: PictureStatistics) -> Reason | None:
    """What is wrong with the picture, the gravest first; None if nothing is."""
    if picture.saturated > SATURATED_SHARE:
        return Reason.SATURATED
    if picture.background_range > STRAY_RANGE_DN or picture.background > STRAY_BACKGROUND_DN:
        return Reason.STRAY_LIGHT
    if picture.elongated >= STREAKS and picture.aligned >= ALIGNED:
        return Reason.SMEAR
    tracks = picture.elongated >= TRACKS and not picture.large
    if tracks or picture.spikes > MANY_SPIKES + SPIKES_BY_NOISE * picture.noise:
        return Reason.RADIATION
    return None
