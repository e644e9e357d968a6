"""Why a picture gave no attitude, by what was measured in it: an extension of section 2.2.

Light that spoils a picture is told by its own traces: too bright for stars, a level that is high or
changes over the field, bright pixels that are no stars. Only without any of them the search for the
attitude itself is to blame. Section 1.3 of the thesis asks that pictures hit by radiation are
invalidated: one is whose every star must be expected to hold a hit.
"""

from cubestack.firmware_model.aramis.field import Field
from cubestack.firmware_model.aramis.solution import Solution, StarList
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason

MOST_HIT = 0.04
"""Share of pixels that are hit: one in a window of 25, in which a spike is told from a star."""

MANY_SPIKES = 40
"""Pixels above noise that no star explains: a quiet picture has fewer (measured)."""

BLIND_SHARE = 0.004
"""Of the field: the Moon's disc with its glare, not a bright star."""

WIDE_PX = 2500
"""A bright region that no star fills."""

HIGH_LEVEL, LARGE_SPREAD = 20.0, 10.0
"""Counts: a dark sky stays below both (measured)."""

#: Of a search that found no attitude, which says nothing of the cause.
_OPEN = (Reason.UNCONFIRMED, Reason.NO_TRIANGLE, Reason.NO_TIME, Reason.TOO_FEW_STARS)


def is_hit(stars: StarList, field: Field) -> bool:
    """Whether a picture has so many hits that no star in it can be trusted."""
    return stars.light is not None and stars.light.spikes > MOST_HIT * field.pixels


def true_reason(solution: Solution, field: Field) -> Reason:
    """The reason of a solution; of one without attitude, what spoilt the picture."""
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
