"""The covariance that stars and the declared tolerance of the lens support.

Which lens is believed is decided by evidence. Evidence favours the simpler of two lenses that fit
alike, since of the more general kind few members fit. That is no reason to claim that the lens is
the simple one: a principal point elsewhere that leaves no residual is as possible as before. The
claim therefore weighs each kind of lens nearly by its likelihood alone, and

- never excludes a lens within its tolerance by more than the stars do;
- by few stars, which can hardly check twelve parameters, does not exclude others either, nor that
  residuals that the believed one leaves, or that none can check, are of another cause;
- has the tails of Student's t distribution: four standard deviations are exceeded no more often
  than by a normal one, although the stars' errors are partly known from few residuals.
"""

import numpy as np

from cubestack.firmware_model.attitude.lens_evidence import Evidence, normalised
from cubestack.firmware_model.attitude.lens_fit import (
    PRIOR_DEGREES,
    FittedLens,
    LensStars,
    small_turn,
)
from cubestack.firmware_model.attitude.lens_models import DESCRIBED, LARGEST, TOLERATED, Reals

CHECKED = 1.8  #: coordinates of stars per parameter of the largest lens that can check it (chosen)
SIMPLER = 0.3  #: power of the share of usual errors that is left, where they can (chosen)
OTHERS = 2.5  #: factor of the probability of other lenses, where they cannot (chosen)

_SIGMAS = 4.0  # that the claim is made for


def claimed_covariance(
    stars: LensStars,
    fits: list[FittedLens],
    evidence: Evidence,
    believed: FittedLens,
    reported: Reals,
) -> Reals:
    """Covariance (3, 3) in rad^2 of an attitude ``reported`` (3, 3), by the ``believed`` of
    ``lenses``' fits."""
    count = len(stars.pixels)
    is_checked = 2 * count >= CHECKED * len(fits[LARGEST].covariance)
    weights = _weights(fits, evidence, is_checked=is_checked)
    if not is_checked and not believed.explains:
        weights[DESCRIBED] = 1.0
    stars.meter.charge(f32_mul=60 * len(fits), f32_add=45 * len(fits), loop=len(fits))
    claimed = np.zeros((3, 3))
    for one, weight in zip(fits, weights, strict=True):
        off = small_turn(one.rotation @ reported.T)
        observed = max(2 * count - len(one.covariance), 0) / evidence.common
        wider = evidence.common * (1 + stars.rest(one)) * _tails(PRIOR_DEGREES + observed)
        claimed += weight * (one.covariance[:3, :3] * wider + np.outer(off, off))
    return claimed


def _weights(fits: list[FittedLens], evidence: Evidence, *, is_checked: bool) -> Reals:
    """Of each lens; more than 1 in total where one is not excluded whatever its probability."""
    likelihood = evidence.likelihood
    if is_checked:
        weights = normalised(likelihood + SIMPLER * evidence.left)
    else:
        other = np.array([one.model.is_other for one in fits])
        weights = normalised(likelihood + np.log(OTHERS) * other)
    relative = likelihood - np.log([one.model.prior for one in fits])
    weights[TOLERATED] = max(weights[TOLERATED], np.exp(relative[TOLERATED] - relative.max()))
    return weights


def _tails(degrees: float) -> float:
    """By how much a variance must grow with these degrees of freedom: D. L. Wallace, "Bounds on
    normal approximations to Student's and the chi-square distributions", Annals of Mathematical
    Statistics 30 (1959)."""
    normal = _SIGMAS * (8 * degrees + 3) / (8 * degrees + 1)
    return float(degrees * np.expm1(normal**2 / degrees) / _SIGMAS**2)
