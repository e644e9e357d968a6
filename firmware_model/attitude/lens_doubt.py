"""Whether the stars of a picture agree with the lens that is described, and what follows if not.

The attitude is fitted together with each of several errors of the lens: focal length, shape of the
pixels (fx and fy that differ, skew), principal point, distortion. Each has a probability before the
picture, and a usual size. The evidence of a fit is its likelihood, times the share of the usual
size that the picture leaves (Laplace's approximation; D. MacKay, "Information Theory, Inference,
and Learning Algorithms", chapter 28). The covariance is that of the mixture of all, about the
attitude that is reported: a lens that the picture does not exclude counts in proportion to its
probability. A principal point moves the boresight and, in a narrow field, hardly anything else, so
this is most of the error that an exact lens would not have.

Stars' errors beyond the declared ones that no lens explains are taken to be common to neighbouring
stars: they then count as fewer observations.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.quest import AttitudeError, dcm, quest
from cubestack.firmware_model.attitude.robust_fit import TAILS, AttitudeFit
from cubestack.firmware_model.mcu.costs import Meter

Floats = NDArray[np.float32]
Reals = NDArray[np.float64]
Rays = Callable[[Floats], Floats]  #: unit vectors (n, 3) of pixels (n, 2)

UNIT_PX = 512.0  #: distance from the principal point at which errors of the lens are given in px

#: Sizes in px at that distance: focal length, aspect, skew, shift across and down, distortion.
USUAL_PX = np.array((15.0, 13.0, 13.0, 20.0, 20.0, 6.0, 3.0, 3.0))
NEAR_PX = 5.0  #: a principal point that is off by little

#: Standard deviation across the boresight above which a lens that is not as described is refused,
#: in rad: three of them are 0.1 deg.
LARGEST_SIGMA_RAD = 5.8e-4

ODDS = 20.0  #: of an error of the principal point, below which the boresight stays as described
CALM = 2.0  #: variance of the residuals, of the declared one, up to which one step is enough
ROUNDS = 3
SMALL_PX = 1.0  #: a step of the lens' errors after which another round changes nothing that counts
COMMON = 2.0  #: further observations that one star's unexplained error makes worthless (chosen)

_PRIOR_DEGREES = 6.0  #: observations that the declared errors count for
_STEP_PX = np.float32(0.5)


@dataclass(frozen=True)
class LensModel:
    """Errors of the lens that are fitted together: columns of ``_fields``."""

    columns: tuple[int, ...]
    prior: float  #: share of the doubt
    near: bool = False
    moves_boresight: bool = False

    @property
    def usual_px(self) -> Reals:
        usual = USUAL_PX.copy()
        if self.near:
            usual[3:5] = NEAR_PX
        return usual[list(self.columns)]


DESCRIBED = LensModel((), 0.0)
LENSES = (
    LensModel((0,), 0.18),
    LensModel((0, 1, 2), 0.18),
    LensModel((3, 4), 0.33, near=True, moves_boresight=True),
    LensModel((3, 4), 0.13, moves_boresight=True),
    LensModel((0, 1, 2, 3, 4), 0.05, moves_boresight=True),
    LensModel((0, 5), 0.04),
    LensModel((0, 1, 2, 5), 0.02),
    LensModel(tuple(range(8)), 0.07, moves_boresight=True),
)

#: Probability that a lens is not as described, before the first picture.
DOUBT = 0.45


@dataclass(frozen=True, eq=False)
class LensVerdict:
    """The attitude that the stars support, whatever the lens."""

    quaternion: Floats  #: (4,), scalar last, reference to camera
    covariance: Floats  #: (3, 3) of the small rotation's error about the camera's axes, rad^2
    as_described: bool  #: whether at most the focal length differs
    error_px: Reals  #: (8,) fitted errors of the lens, as ``USUAL_PX``

    @property
    def is_refused(self) -> bool:
        """Whether the lens is not as described and the boresight is too uncertain for it."""
        across = float(np.sqrt(max(self.covariance[0, 0], self.covariance[1, 1])))
        return not self.as_described and across > LARGEST_SIGMA_RAD


@dataclass(frozen=True, eq=False)
class _Fitted:
    """One lens, fitted."""

    model: LensModel
    rotation: Reals  #: (3, 3)
    error_px: Reals  #: of its columns
    covariance: Reals  #: of the rotation and the columns, by the residuals that are left
    squares: Reals  #: (n,) residuals in declared variances
    spread: float  #: variance of the residuals, of the declared one


def judge_lens(
    pixels: Floats,
    reference: Floats,
    sigmas: Floats,
    rays: Rays,
    centre: tuple[float, float],
    fit: AttitudeFit,
    meter: Meter,
    doubt: float = DOUBT,
) -> LensVerdict:
    """Judge a lens by identified stars.

    Args:
        pixels: (n, 2) places on the picture.
        reference: (n, 3) unit vectors of the catalogue.
        sigmas: (n,) declared errors in rad.
        rays: the lens as described.
        centre: column and row of its principal point.
        fit: of the same stars with that lens.
        meter: charged with every operation.
        doubt: probability before the picture that the lens is not as described; 0 believes it.
    """
    described = LensVerdict(fit.quaternion, fit.covariance, True, np.zeros(8))
    if doubt <= 0:
        return described
    start = dcm(fit.quaternion, meter).astype(float)
    known, errors = reference.astype(float), sigmas.astype(float)
    stars = _Stars(pixels, known, errors, rays, centre, meter, start)
    squares = (fit.residuals.astype(float) / stars.sigmas) ** 2
    calm = fit.scale == 1.0 and _spread(squares, np.ones(len(squares)), 3) < CALM
    fits = [
        found
        for model in (DESCRIBED, *LENSES)
        if (found := stars.fit(model, squares, 1 if calm else ROUNDS)) is not None
    ]
    if not fits:
        return described
    common = 1 + COMMON * (1 - 1 / min(one.spread for one in fits))
    logs = np.array([_evidence(one, doubt, common) for one in fits])
    shares = np.exp(logs - logs.max())
    shares /= shares.sum()
    moving = np.array([one.model.moves_boresight for one in fits])
    believed = shares.copy()
    if shares[~moving].sum() * (1 + ODDS) > 1:
        believed[moving] = 0
    chosen = fits[int(believed.argmax())]
    as_described = chosen.model.columns in ((), (0,))
    rotation = start if as_described else chosen.rotation
    covariance = np.zeros((3, 3))
    for one, share in zip(fits, shares, strict=True):
        off = _small_turn(one.rotation @ rotation.T)
        covariance += share * (one.covariance[:3, :3] * common + np.outer(off, off))
    error_px = np.zeros(8)
    error_px[list(chosen.model.columns)] = chosen.error_px
    if as_described:
        covariance += fit.covariance * shares[[one is chosen for one in fits]].sum()
        return LensVerdict(fit.quaternion, covariance.astype(np.float32), True, error_px)
    try:
        quaternion = stars.attitude(chosen, meter)
    except AttitudeError:
        return described
    return LensVerdict(quaternion, covariance.astype(np.float32), False, error_px)


@dataclass(eq=False)
class _Stars:
    """Identified stars, and the lens as described."""

    pixels: Floats
    reference: Reals
    sigmas: Reals
    rays: Rays
    centre: tuple[float, float]
    meter: Meter
    start: Reals  #: (3, 3) attitude with that lens

    @cached_property
    def _first(self) -> tuple[Reals, Reals]:
        """``_linear`` of all errors, from the start."""
        self._charge_products(len(self.pixels), len(USUAL_PX))
        return self._linear(self.start, _fields(self.pixels, self.centre), np.zeros(len(USUAL_PX)))

    def fit(self, model: LensModel, squares: Reals, rounds: int) -> _Fitted | None:
        """A lens fitted from the start, whose residuals are ``squares``; None if nothing determines
        it. Stars far from their places weigh less, as in ``robust_fit``."""
        rotation, count, size = self.start, len(self.pixels), len(model.columns)
        fields = _fields(self.pixels, self.centre)[list(model.columns)]
        usual = model.usual_px
        error_px, spread = np.zeros(size), 1.0
        weights = np.minimum((TAILS + 2) / (TAILS + squares), 1)
        for number in range(rounds):
            if number:
                design, apart = self._linear(rotation, fields, error_px)
                self._charge_products(count, size)
            else:  # the same for all lenses
                every, apart = self._first
                design = every[[0, 1, 2, *(3 + column for column in model.columns)]]
            scaled = design / self.sigmas[:, None] * np.sqrt(weights)[:, None]
            wanted = apart / self.sigmas[:, None] * np.sqrt(weights)[:, None]
            rows = scaled.reshape(3 + size, -1)
            known = rows @ rows.T
            normal = known.copy()
            # A turn that nothing determines is none, as is an error beyond its usual size.
            slack = np.concatenate([np.full(3, 1e-3), spread / usual**2])
            normal[np.diag_indices(3 + size)] += slack
            told = rows @ wanted.reshape(-1)
            told[3:] -= slack[3:] * error_px
            try:
                step = np.asarray(np.linalg.solve(normal, told), float)
                inverse = np.asarray(np.linalg.inv(normal), float)
            except np.linalg.LinAlgError:
                return None
            self._charge_solution(count, size)
            rotation = _turn(step[:3]) @ rotation
            error_px = error_px + step[3:]
            left = apart - np.tensordot(step, design, 1)
            squares = np.sum(left * left, axis=1) / self.sigmas**2
            spread = _spread(squares, weights, float(np.sum(inverse * known)))
            weights = np.minimum((TAILS + 2) / (TAILS + squares / spread), 1)
            if np.abs(step[3:]).max(initial=0.0) < SMALL_PX:
                break
        return _Fitted(model, rotation, error_px, inverse * spread, squares, spread)

    def _linear(self, rotation: Reals, fields: Reals, error_px: Reals) -> tuple[Reals, Reals]:
        """What turns and errors of the lens change, (3 + k, n, 3), and what is left (n, 3)."""
        pixels = self.pixels - np.tensordot(error_px, fields, 1).astype(np.float32)
        predicted = self.reference @ rotation.T
        design = np.zeros((3 + len(fields), len(pixels), 3))
        for axis in range(3):
            design[axis] = np.cross(np.eye(3)[axis], predicted)
        if len(fields):
            across, down = (
                (self.rays(pixels + step) - self.rays(pixels - step)).astype(float)
                / (2 * float(_STEP_PX))
                for step in np.eye(2, dtype=np.float32) * _STEP_PX
            )
            design[3:] = fields[..., :1] * across + fields[..., 1:] * down
        return design, self.rays(pixels).astype(float) - predicted

    def attitude(self, fitted: _Fitted, meter: Meter) -> Floats:
        """Quaternion (4,) of the stars with a fitted lens. Raises AttitudeError."""
        fields = _fields(self.pixels, self.centre)[list(fitted.model.columns)]
        pixels = self.pixels - np.tensordot(fitted.error_px, fields, 1).astype(np.float32)
        trust = np.minimum((TAILS + 2) / (TAILS + fitted.squares / fitted.spread), 1)
        weights = (trust / self.sigmas**2).astype(np.float32)
        return quest(self.rays(pixels), self.reference.astype(np.float32), weights, meter)

    def _charge_products(self, count: int, size: int) -> None:
        """The normal equations; ``rays`` charge themselves."""
        columns = 3 + size
        products = count * (3 * columns * (columns + 3) // 2 + 6 * size + 9)
        self.meter.charge(f32_mul=products, f32_add=products, f32_div=count, loop=count * columns)

    def _charge_solution(self, count: int, size: int) -> None:
        """Cholesky's factors, solution, trace of the inverse, residuals and weights."""
        columns = 3 + size
        solved = columns**3 // 3 + 2 * columns**2 + count * (3 * columns + 6)
        self.meter.charge(
            f32_mul=solved, f32_add=solved, f32_div=columns + 2 * count, f32_sqrt=columns
        )


def _fields(pixels: Floats, centre: tuple[float, float]) -> Reals:
    """Displacements (8, n, 2) of the stars' places for an error of 1 px each, as ``USUAL_PX``."""
    x, y = ((pixels - np.array(centre)) / UNIT_PX).T
    one, none, r2 = np.ones_like(x), np.zeros_like(x), x * x + y * y
    fields = [
        (x, y),
        (x, -y),
        (y, none),
        (one, none),
        (none, one),
        (r2 * x, r2 * y),
        (3 * x * x + y * y, 2 * x * y),
        (2 * x * y, x * x + 3 * y * y),
    ]
    return np.array(fields, float).transpose(0, 2, 1)


def _spread(squares: Reals, weights: Reals, fitted: float) -> float:
    """Variance of the residuals, of the declared one, at least 1; ``fitted`` parameters."""
    freedom = max(2 * len(squares) - fitted, 0.0)
    return max(1.0, float((_PRIOR_DEGREES + weights @ squares) / (_PRIOR_DEGREES + freedom)))


def _evidence(fitted: _Fitted, doubt: float, common: float) -> float:
    """Logarithm of the probability of a lens, up to a constant; see the module."""
    model, spread = fitted.model, fitted.spread
    prior = doubt * model.prior if model.columns else max(1 - doubt, 1e-6)
    observations = 2 * len(fitted.squares) - 3 + _PRIOR_DEGREES
    likelihood = -(TAILS + 2) / 2 * np.log1p(fitted.squares / spread / TAILS).sum()
    log = np.log(prior) + (likelihood - observations / 2 * np.log(spread)) / common
    if model.columns:
        usual = model.usual_px
        log -= float(np.sum((fitted.error_px / usual) ** 2)) / 2
        known = np.linalg.inv(fitted.covariance[3:, 3:] * common) * np.outer(usual, usual)
        log -= np.linalg.slogdet(known)[1] / 2
    return float(log)


def _turn(vector: Reals) -> Reals:
    """Rotation (3, 3) by a vector (3,) in rad."""
    a, b, c = vector / 2
    cross = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
    return np.asarray(np.eye(3) + 2 / (1 + a * a + b * b + c * c) * (cross + cross @ cross))


def _small_turn(rotation: Reals) -> Reals:
    """Vector (3,) of a small rotation (3, 3), rad."""
    (_, c, e), (d, _, g), (f, h, _) = rotation
    return np.array([h - g, e - f, d - c]) / 2
