"""Quality of an attitude: the fields of telemetry Quality that every star tracker has.

A standard deviation of `UNKNOWN_RAD` means unknown: there is no attitude, or an unrated one.
"""

import math
from collections.abc import Mapping, Sequence

from cubestack.firmware_model.interface.codec.field import Field, Value, f32, u8

UNKNOWN_RAD = math.pi

ATTITUDE_QUALITY: tuple[Field, ...] = (
    u8("Matched", "stars used for the attitude"),
    u8("Expected", "catalogue stars in the image with this attitude"),
    f32("LogFalseAlarm", "decimal logarithm of the probability of such a match by chance"),
    f32("Residual", "root mean square of the stars' residuals in each axis", "rad"),
    f32("SigmaX", "standard deviation about the camera's x axis; pi: unknown", "rad"),
    f32("SigmaY", "the same about its y axis", "rad"),
    f32("SigmaZ", "the same about its boresight", "rad"),
    f32("CorrelationXY", "correlation of the errors about x and y"),
    f32("CorrelationXZ", "the same about x and z"),
    f32("CorrelationYZ", "the same about y and z"),
    f32("Scale", "measured focal length divided by the setting"),
)

UNRATED: dict[str, Value] = {
    **{field.name: 0 for field in ATTITUDE_QUALITY},
    **dict.fromkeys(("SigmaX", "SigmaY", "SigmaZ"), UNKNOWN_RAD),
    "Scale": 1.0,
}
"""Values of these fields for an unrated attitude."""

#: Smaller probabilities are reported as this one.
SMALLEST_FALSE_ALARM = 1e-30

_PAIRS = {"CorrelationXY": (0, 1), "CorrelationXZ": (0, 2), "CorrelationYZ": (1, 2)}


def log_false_alarm(probability: float) -> float:
    return math.log10(max(probability, SMALLEST_FALSE_ALARM))


def covariance_fields(covariance: Sequence[Sequence[float]]) -> dict[str, Value]:
    """Fields Sigma and Correlation of a covariance, three rows of three, rad^2."""
    sigmas = [math.sqrt(covariance[axis][axis]) for axis in range(3)]
    values: dict[str, Value] = dict(zip(("SigmaX", "SigmaY", "SigmaZ"), sigmas, strict=True))
    return values | {
        name: covariance[one][other] / (sigmas[one] * sigmas[other])
        for name, (one, other) in _PAIRS.items()
    }


def read_covariance(values: Mapping[str, Value]) -> tuple[tuple[float, float, float], ...]:
    """Covariance, three rows of three, rad^2, from the fields Sigma and Correlation.

    Raises ValueError for values that no covariance has.
    """
    sigmas = [float(values[f"Sigma{axis}"]) for axis in "XYZ"]
    correlations = {axes: float(values[name]) for name, axes in _PAIRS.items()}
    known = all(sigma >= 0 for sigma in sigmas)
    if not (known and all(abs(each) <= 1 for each in correlations.values())):
        raise ValueError(f"sigmas must be 0 or more and correlations within 1, not {dict(values)}")

    def row(one: int) -> tuple[float, float, float]:
        x, y, z = (
            sigmas[one] * sigmas[other] * correlations.get((min(one, other), max(one, other)), 1.0)
            for other in range(3)
        )
        return x, y, z

    return tuple(row(axis) for axis in range(3))
