"""An attitude fitted together with errors of the lens."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cubestack.firmware_model.attitude.lens_models import (
    COUNT,
    Floats,
    LensErrors,
    LensModel,
    Reals,
    displacements,
)
from cubestack.firmware_model.attitude.quest import quest
from cubestack.firmware_model.attitude.robust_fit import HALF_CHI2, TAILS
from cubestack.firmware_model.attitude.vectors import cross
from cubestack.firmware_model.mcu.costs import Meter

Rays = Callable[[Floats], Floats]  #: unit vectors (n, 3) of pixels (n, 2)

EXPLAINED = 1.1  #: spread up to which nothing is left to explain,
TESTED = 1.25  #: if there are this many coordinates of stars per fitted parameter
REST = 0.01  #: of a calibration's errors, the share that the nine do not describe (chosen)

PRIOR_DEGREES = 6.0  #: observations that the declared errors count for
_STEP_PX = np.float32(0.5)


@dataclass(frozen=True, eq=False)
class FittedLens:
    """One lens, fitted."""

    model: LensModel
    rotation: Reals  #: (3, 3)
    error_px: Reals  #: (9,)
    covariance: Reals  #: of the rotation and the model's columns, by the residuals that are left
    squares: Reals  #: (n,) residuals in declared variances
    spread: float  #: variance of the residuals, of the declared one
    step_px: float  #: largest change of an error in the last round

    @property
    def explains(self) -> bool:
        """Whether nothing is left to explain, and more is observed than fitted."""
        is_tested = len(self.squares) * 2 >= TESTED * len(self.covariance)
        return is_tested and self.spread < EXPLAINED


@dataclass(frozen=True, eq=False)
class _Equations:
    """What changes the stars' directions, and how much."""

    design: Reals  #: (12, n, 3) by a turn about each axis in rad, and by 1 px of each error
    apart: Reals  #: (n, 3) what is left to explain
    weights: Reals  #: (n,) of the stars, at most 1
    known: Reals  #: (12, 12) information about them
    told: Reals  #: (12,)


@dataclass(eq=False)
class LensStars:
    """Identified stars, and the lens as described."""

    pixels: Floats
    reference: Reals
    sigmas: Reals
    rays: Rays
    centre: tuple[float, float]
    pixel_rad: float
    meter: Meter
    start: Reals  #: (3, 3) attitude with that lens

    @cached_property
    def _fields(self) -> Reals:
        return displacements(self.pixels, self.centre)

    @cached_property
    def _first(self) -> _Equations:
        """The equations of all errors, from the start."""
        design, apart = self._linear(self.start, np.zeros(COUNT))
        squares = np.sum(apart * apart, axis=1) / self.sigmas**2
        spread = max(1.0, float(np.median(squares)) / 2 / HALF_CHI2)
        return self._equations(design, apart, _weights(squares, spread))

    def fit(self, model: LensModel, last: FittedLens | None = None) -> FittedLens:
        """A lens fitted from the start, or from its last fit. Stars far from their places weigh
        less, as in ``robust_fit``."""
        columns = model.columns
        usual = model.sizes.sizes_px[columns]
        every = np.concatenate([np.arange(3), 3 + columns])
        rotation, error_px, spread, equations = self.start, np.zeros(COUNT), 1.0, self._first
        if last is not None:
            rotation, error_px, spread = last.rotation, last.error_px.copy(), last.spread
            weights = _weights(last.squares, spread)
            equations = self._equations(*self._linear(rotation, error_px), weights)
        known, told = equations.known[np.ix_(every, every)], equations.told[every]
        # A turn that nothing determines is none, as is an error beyond its usual size.
        slack = np.concatenate([np.full(3, 1e-3), spread / usual**2])
        told[3:] -= slack[3:] * error_px[columns]
        inverse = np.asarray(np.linalg.inv(known + np.diag(slack)), float)
        step = inverse @ told
        self._charge_solution(len(columns))
        error_px[columns] += step[3:]
        left = equations.apart - np.tensordot(step, equations.design[every], 1)
        squares = np.sum(left * left, axis=1) / self.sigmas**2
        spread = _spread(squares, equations.weights, float(np.sum(inverse * known)))
        return FittedLens(
            model,
            _turn(step[:3]) @ rotation,
            error_px,
            inverse * spread,
            squares,
            spread,
            float(np.abs(step[3:]).max(initial=0.0)),
        )

    def variance(self, sizes: LensErrors) -> float:
        """Larger variance across the boresight with these errors of the lens, and the declared ones
        of the stars."""
        usual = sizes.sizes_px
        columns = np.concatenate([np.arange(3), 3 + np.flatnonzero(usual)])
        slack = np.concatenate([np.full(3, 1e-3), 1 / usual[usual > 0] ** 2])
        known = self._first.known[np.ix_(columns, columns)] + np.diag(slack)
        self._charge_solution(len(columns) - 3)
        return float(np.linalg.inv(known)[[0, 1], [0, 1]].max())

    def rest(self, fitted: FittedLens) -> float:
        """Variance of what a fit leaves in a lens of the tolerance, of the stars' own."""
        if fitted.model.is_other:
            return 0.0
        products = len(self.pixels) * (2 * len(fitted.model.columns) + 3)
        self.meter.charge(f32_mul=products, f32_add=products, f32_div=2)
        moved = np.tensordot(fitted.error_px, self._fields, 1)
        rest_rad = REST * self.pixel_rad * np.sqrt(np.mean(np.sum(moved * moved, axis=1)))
        return float(rest_rad**2 / (np.mean(self.sigmas**2) * fitted.spread))

    def _linear(self, rotation: Reals, error_px: Reals) -> tuple[Reals, Reals]:
        """What turns and errors of the lens change, (12, n, 3), and what is left (n, 3)."""
        pixels = self._corrected(error_px)
        predicted = self.reference @ rotation.T
        across, down = (
            (self.rays(pixels + step) - self.rays(pixels - step)).astype(float)
            / (2 * float(_STEP_PX))
            for step in np.eye(2, dtype=np.float32) * _STEP_PX
        )
        turns = [cross(axis, predicted) for axis in np.eye(3)]
        design = [*turns, *(self._fields[..., :1] * across + self._fields[..., 1:] * down)]
        return np.array(design), self.rays(pixels).astype(float) - predicted

    def _equations(self, design: Reals, apart: Reals, weights: Reals) -> _Equations:
        """The normal equations; ``rays`` charge themselves."""
        rows, count = len(design), len(apart)
        scale = (np.sqrt(weights) / self.sigmas)[:, None]
        scaled, wanted = (design * scale).reshape(rows, -1), (apart * scale).reshape(-1)
        products = count * (3 * rows * (rows + 3) // 2 + 6 * COUNT + 9)
        self.meter.charge(f32_mul=products, f32_add=products, f32_div=count, loop=count * rows)
        return _Equations(design, apart, weights, scaled @ scaled.T, scaled @ wanted)

    def attitude(self, fitted: FittedLens) -> Floats:
        """Quaternion (4,) of the stars with a fitted lens. Raises AttitudeError."""
        trust = _weights(fitted.squares, fitted.spread) / self.sigmas**2
        stars = self.rays(self._corrected(fitted.error_px))
        reference = self.reference.astype(np.float32)
        return quest(stars, reference, trust.astype(np.float32), self.meter)

    def _corrected(self, error_px: Reals) -> Floats:
        """Places (n, 2) on the picture without these errors of the lens."""
        moved = np.tensordot(error_px, self._fields, 1)
        return np.asarray(self.pixels - moved.astype(np.float32), np.float32)

    def _charge_solution(self, size: int) -> None:
        """Cholesky's factors, inverse, solution, residuals and weights."""
        columns, count = 3 + size, len(self.pixels)
        solved = columns**3 + 2 * columns**2 + count * (3 * columns + 6)
        self.meter.charge(
            f32_mul=solved, f32_add=solved, f32_div=columns + 2 * count, f32_sqrt=columns
        )


def _weights(squares: Reals, spread: float) -> Reals:
    return np.minimum((TAILS + 2) / (TAILS + squares / spread), 1)


def _spread(squares: Reals, weights: Reals, fitted: float) -> float:
    """Variance of the residuals, of the declared one, at least 1; ``fitted`` parameters."""
    freedom = max(2 * len(squares) - fitted, 0.0)
    return max(1.0, float((PRIOR_DEGREES + weights @ squares) / (PRIOR_DEGREES + freedom)))


def _turn(vector: Reals) -> Reals:
    """Rotation (3, 3) by a vector (3,) in rad."""
    a, b, c = vector / 2
    cross = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
    return np.asarray(np.eye(3) + 2 / (1 + a * a + b * b + c * c) * (cross + cross @ cross))


def small_turn(rotation: Reals) -> Reals:
    """Vector (3,) of a small rotation (3, 3), rad."""
    (_, c, e), (d, _, g), (f, h, _) = rotation
    return np.array([h - g, e - f, d - c]) / 2
