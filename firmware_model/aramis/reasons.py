"""Reason why an image has no attitude, from measurements of the image: an extension of section 2.2.

What disturbs the picture comes first (``star_tracker.disturbance``); only in an undisturbed one
the search for the attitude itself is to blame. Section 1.3 of the thesis requires that pictures hit
by radiation are invalidated: one is in which every star must be expected to hold a hit.
"""

from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.solution import Solution, StarList
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason
from cubestack.firmware_model.star_tracker.disturbance import DisturbanceLimits

#: Share of hit pixels: one in a window of 25, which distinguishes a spike from a star.
MOST_HIT = 0.04

#: Share of the field: the Moon's disc with its glare, not a bright star. Counts: a dark sky stays
#: below both. Pixels above noise that no star explains: a quiet picture has fewer (all measured).
LIMITS = DisturbanceLimits(saturated=0.004, background=20.0, background_range=10.0, spikes=40)

WIDE_PX = 2500  #: a bright region that no star fills

#: Of a search that found no attitude, which says nothing of the cause.
_OPEN = (Reason.UNCONFIRMED, Reason.NO_TRIANGLE, Reason.NO_TIME, Reason.TOO_FEW_STARS)


def is_hit(stars: StarList, field: CameraField) -> bool:
    """Whether a picture has so many hits that no star in it can be trusted."""
    return stars.light is not None and stars.light.spikes > MOST_HIT * field.pixels


def true_reason(solution: Solution) -> Reason:
    """The reason of a solution; of one without attitude, what disturbed the picture."""
    light = solution.measured.light
    found = solution.outcome is not MeasurementOutcome.NONE
    if light is None or found or solution.reason not in _OPEN:
        return solution.reason
    disturbance = LIMITS.exceeded(light, large=light.widest > WIDE_PX)
    return solution.reason if disturbance is None else Reason[disturbance.name]
