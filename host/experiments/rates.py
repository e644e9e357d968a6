"""Rates of outcomes and their confidence limits."""

from math import sqrt
from typing import Any, Literal

CONFIDENCE_Z = 1.96  # of 95 %

Outcome = Literal["right", "refused", "wrong"]


def outcome(result: Any) -> Outcome:
    return "right" if result.right else "wrong" if result.solved else "refused"


def why_refused(result: Any) -> str:
    return str(result.reason or result.ending)


def wilson(count: int, of: int, z: float = CONFIDENCE_Z) -> tuple[float, float]:
    """Wilson limits (JASA 22, 209, 1927) of a rate, 0 to 1, seen in ``count`` of ``of`` cases.

    0 and 1 if nothing was seen.
    """
    if of == 0:
        return 0.0, 1.0
    rate, z2 = count / of, z * z
    middle = rate + z2 / (2 * of)
    half = z * sqrt(rate * (1 - rate) / of + z2 / (4 * of * of))
    low, high = (middle - half) / (1 + z2 / of), (middle + half) / (1 + z2 / of)
    return (0.0 if count == 0 else low), (1.0 if count == of else high)
