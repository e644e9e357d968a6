"""Attitude, focal length and covariance from identified stars of which some may be displaced.

QUEST is repeated with smaller weights for stars that are far from where the attitude puts them: the
weights of errors with the tails of Student's t distribution (K. L. Lange, R. J. A. Little and J. M.
G. Taylor, "Robust statistical modeling using the t distribution", Journal of the American
Statistical Association 84 (1989), section 3). A star at the edge of the image, beside a hot pixel
or with a neighbour is displaced by many of its sigmas, and would rotate the attitude.

The stars also determine the ratio of the focal length to its setting. It is corrected only where
the difference is significant: stars on one side of the boresight can hardly separate it from a
rotation, and a camera as calibrated has none. The covariance then includes its uncertainty.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.covariance import covariance, information, inverse
from cubestack.firmware_model.attitude.geometry import scaled
from cubestack.firmware_model.attitude.quest import dcm, quest
from cubestack.firmware_model.attitude.vectors import cross
from cubestack.firmware_model.mcu.costs import Meter

Floats = NDArray[np.float32]

TAILS = 5.0  #: degrees of freedom of the errors' distribution: a star at 3 sigma weighs half

ROUNDS = 4
SIGNIFICANT = 4.0  #: sigmas that the focal length must be off before it is corrected
HALF_CHI2 = 0.693  #: median of half the squared length of an error in two axes of sigma 1


@dataclass(frozen=True, eq=False)
class AttitudeFit:
    """An attitude and its error."""

    quaternion: Floats  #: (4,), scalar last, reference to camera
    covariance: Floats  #: (3, 3) of the small rotation's error about the camera's axes, rad^2
    residuals: Floats  #: (n,) angles in rad between the stars and where the attitude puts them
    scale: float  #: measured focal length over the one that is set


def robust_fit(
    measured: Floats,
    reference: Floats,
    sigmas: Floats,
    meter: Meter,
    *,
    scale: float,
    excess: float,
    beyond: float = 1.0,
) -> AttitudeFit:
    """Fit ``reference`` (n, 3) to ``measured`` (n, 3), unit vectors of the set focal length.

    ``sigmas`` (n,) are the stars' expected errors in rad, ``scale`` the first guess; ``excess`` and
    ``beyond``: see ``covariance``. Raises AttitudeError as QUEST does.
    """
    believed = sigmas.astype(np.float32)
    trusted, free = believed, scale != 1.0
    for number in range(ROUNDS + 1):
        stars = scaled(measured, 1 / scale, meter)
        weights = np.float32(1) / (trusted * trusted)
        quaternion = quest(stars, reference, weights, meter)
        apart = stars - reference @ dcm(quaternion, meter).T
        squares = np.sum(apart * apart, axis=1)
        meter.charge(
            f32_mul=14 * len(stars), f32_add=11 * len(stars), f32_div=len(stars), loop=len(stars)
        )
        if number == ROUNDS:
            break
        stretch = _Stretch.of(stars, apart, trusted, meter)
        free = free or stretch.is_significant
        if free:
            scale *= 1 + stretch.factor
            if number == 0:
                continue  # before stars are blamed for what the focal length does
        relative = squares / (believed * believed)
        spread = max(1.0, float(np.median(relative)) / 2 / HALF_CHI2)
        trust = np.minimum((TAILS + 2) / (TAILS + relative / np.float32(spread)), 1)
        trusted = np.asarray(believed / np.sqrt(trust), np.float32)
        meter.charge(
            f32_div=4 * len(stars),
            f32_sqrt=len(stars),
            f32_compare=len(stars) * (1 + len(stars) // 4),  # the median, by sorting
            loop=len(stars),
        )
    residuals = np.sqrt(squares)
    claimed = covariance(stars, residuals, trusted, meter, excess=excess, beyond=beyond)
    if free:
        # The posterior scale of the variance counts for both.
        ratio = np.trace(claimed) / np.trace(stretch.alone)
        turn = stretch.turn * np.float32(stretch.sigma)
        claimed = claimed + np.outer(turn, turn) * ratio
    return AttitudeFit(quaternion, np.asarray(claimed, np.float32), residuals, scale)


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Relative excess of the stars' distances from the boresight, beside the best attitude."""

    #: part of the tangents of their field angles, and its standard deviation
    factor: float
    sigma: float
    spread: float  #: mean square of the residuals that it leaves, of their expected ones
    turn: Floats  #: (3,) rotation of the attitude that a factor of 1 brings with it, rad
    alone: Floats  #: (3, 3) covariance of the attitude without a factor

    @property
    def is_significant(self) -> bool:
        """Whether it exceeds chance, for errors as large as the residuals left."""
        return bool(abs(self.factor) > SIGNIFICANT * self.sigma * max(self.spread, 1.0) ** 0.5)

    @classmethod
    def of(cls, stars: Floats, apart: Floats, sigmas: Floats, meter: Meter) -> "_Stretch":
        """By least squares beside the rotation, whose own equations are solved already."""
        weights = np.float32(1) / (sigmas * sigmas)
        total = np.float32(weights.sum())
        weights = weights / total
        x, y, z = stars.T
        away = np.stack([z * z * x, z * z * y, -z * (1 - z * z)], axis=1)
        alone = inverse(information(stars, weights, meter), meter)
        shared = np.sum(weights[:, None] * cross(stars, away), axis=0)
        turn = -alone @ shared
        known = np.sum(weights * np.sum(away * away, axis=1)) + shared @ turn
        told = np.sum(weights * np.sum(away * apart, axis=1))
        meter.charge(
            f32_mul=25 * len(stars) + 12, f32_add=14 * len(stars) + 9, f32_div=2, f32_sqrt=1
        )
        known = max(float(known), 1e-9)
        squares = float(np.sum(weights * np.sum(apart * apart, axis=1)))
        left = max(squares - float(told) ** 2 / known, 0.0) * float(total)
        return cls(
            factor=float(told) / known,
            sigma=float((known * total) ** -0.5),
            spread=left / max(2 * len(stars) - 4, 1),
            turn=turn,
            alone=alone / np.float32(total),
        )
