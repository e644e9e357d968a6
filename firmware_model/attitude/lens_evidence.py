"""Fits of several kinds of lenses, and how probable each is.

The evidence is the likelihood of the fit, times the share of the usual sizes of the errors that the
picture leaves (Laplace's approximation; D. MacKay, "Information Theory, Inference, and Learning
Algorithms", chapter 28).

Stars' errors beyond the declared ones that no lens explains are taken to be common to neighbouring
stars: they then count as fewer observations.
"""

from dataclasses import dataclass

import numpy as np

from cubestack.firmware_model.attitude.lens_fit import PRIOR_DEGREES, FittedLens, LensStars
from cubestack.firmware_model.attitude.lens_models import LensModel, Reals
from cubestack.firmware_model.attitude.robust_fit import TAILS
from cubestack.firmware_model.mcu.costs import Meter

COMMON = 4.0  #: further observations that one star's unexplained error makes worthless (chosen)
UNEXPLAINED = 3.0  #: spread from which on errors count as unexplained

POSSIBLE = 1e-3  #: probability from which on a lens is fitted again
SMALL_PX = 1.0  #: a step of the lens' errors after which another round changes nothing that counts

_LOGARITHM = {"f32_mul": 11, "f32_add": 11, "f32_div": 1}  # a polynomial of eleven terms


@dataclass(frozen=True, eq=False)
class Evidence:
    """Of several fits of the same stars."""

    common: float  #: observations that one star's error makes worthless, itself among them
    likelihood: Reals  #: logarithm of each, with the prior probability of the lens' errors
    left: Reals  #: logarithm of the share of the usual errors that the picture leaves

    @property
    def probabilities(self) -> Reals:
        return normalised(self.likelihood + self.left)


def fitted_lenses(stars: LensStars, models: tuple[LensModel, ...]) -> list[FittedLens]:
    """The lenses fitted from the start; those that are possible and moved far, once more."""
    found = [stars.fit(model) for model in models]
    shares = evidence(found, stars.meter).probabilities
    return [
        stars.fit(one.model, one) if share > POSSIBLE and one.step_px > SMALL_PX else one
        for one, share in zip(found, shares, strict=True)
    ]


def evidence(fits: list[FittedLens], meter: Meter) -> Evidence:
    """Weigh several fits of the same stars."""
    for one in fits:  # a product of the stars, a determinant; three logarithms, an exponential
        count, size = len(one.squares), len(one.model.columns)
        products = count + size**3 // 3 + 2 * size
        meter.charge(f32_mul=products, f32_add=products, f32_div=2 * count + 2 * size)
        meter.charge(**{name: 4 * each for name, each in _LOGARITHM.items()})
    common = 1 + COMMON * (1 - 1 / max(1.0, min(one.spread for one in fits) / UNEXPLAINED))
    likelihood = np.array([_likelihood(one, common) for one in fits])
    return Evidence(common, likelihood, np.array([_left(one, common) for one in fits]))


def normalised(logarithms: Reals) -> Reals:
    """Probabilities with these logarithms, up to a constant."""
    shares = np.exp(logarithms - logarithms.max())
    return np.asarray(shares / shares.sum())


def _likelihood(fitted: FittedLens, common: float) -> float:
    model, spread = fitted.model, fitted.spread
    observations = 2 * len(fitted.squares) - 3 + PRIOR_DEGREES
    likelihood = -(TAILS + 2) / 2 * np.log1p(fitted.squares / spread / TAILS).sum()
    relative = fitted.error_px[model.columns] / model.sizes.sizes_px[model.columns]
    likelihood -= observations / 2 * np.log(spread)
    return float(np.log(model.prior) + likelihood / common - relative @ relative / 2)


def _left(fitted: FittedLens, common: float) -> float:
    usual = fitted.model.sizes.sizes_px[fitted.model.columns]
    left = fitted.covariance[3:, 3:] * common / np.outer(usual, usual)
    return float(np.linalg.slogdet(left)[1] / 2)
