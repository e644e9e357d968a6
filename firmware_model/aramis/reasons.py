"""Reason why an image has no attitude, from measurements of the image: an extension of section 2.2.

Light that spoils an image has measurable signs: parts too bright for stars, a level that is high or
changes over the field, bright pixels that are no stars. Only without any of them is the search for
the attitude itself the cause. Section 1.3 of the thesis requires that images hit by radiation are
invalidated: an image is hit if every star in it is expected to contain a hit.
"""

from cubestack.firmware_model.aramis.field import Field
from cubestack.firmware_model.aramis.solution import Solution, StarList
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason

#: Share of hit pixels: one in a window of 25, which distinguishes a spike from a star.
MOST_HIT = 0.04

MANY_SPIKES = 40  #: pixels above noise that no star explains: a quiet image has fewer (measured)
BLIND_SHARE = 0.004  #: of the field: the Moon's disc with its glare, not a bright star
WIDE_PX = 2500  #: a bright region larger than any star
HIGH_LEVEL, LARGE_SPREAD = 20.0, 10.0  #: counts: a dark sky stays below both (measured)

#: Reasons of a search without attitude, which do not give the cause.
_OPEN = (Reason.UNCONFIRMED, Reason.NO_TRIANGLE, Reason.NO_TIME, Reason.TOO_FEW_STARS)


def is_hit(stars: StarList, field: Field) -> bool:
    """Whether an image has so many hits that no star in it is reliable."""
    return stars.light is not None and stars.light.spikes > MOST_HIT * field.pixels


def true_reason(solution: Solution, field: Field) -> Reason:
    """The reason of a solution; without an attitude, what spoilt the image."""
    light = solution.measured.light
    found = solution.outcome is not MeasurementOutcome.NONE
    if light is None or found or solution.reason not in _OPEN:
        return solution.reason
    if light.blind > BLIND_SHARE or light.widest > WIDE_PX:
        return Reason.SATURATED
    if light.level > HIGH_LEVEL or light.spread > LARGE_SPREAD:
        return Reason.STRAY_LIGHT
    if light.spikes > MANY_SPIKES:
        return Reason.RADIATION
    return solution.reason
