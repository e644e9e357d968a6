"""Whether the stars of a picture agree with the lens that is described, and what follows if not.

Residuals within the stars' declared errors leave the description as it is. Otherwise the attitude
is fitted together with nine errors of the lens: focal length, shape of the pixels (fx and fy that
differ, skew), principal point, distortion. Lenses differ in how large each error usually is:

- the lens as described, whose stars are displaced by something else;
- a lens within the tolerance of its calibration, with and without another principal point;
- a lens that is not the one described: rare, and with errors far beyond the tolerance.

The evidence of a lens is the likelihood of its fit, times the share of the usual sizes that the
picture leaves (Laplace's approximation; D. MacKay, "Information Theory, Inference, and Learning
Algorithms", chapter 28). The covariance is that of the mixture of all, about the attitude that is
reported: a lens that the picture does not exclude counts in proportion to its probability. So a
tolerance widens the claim and refuses nothing; refused is only another lens that has won, if the
boresight stays uncertain.

Stars' errors beyond the declared ones that no lens explains are taken to be common to neighbouring
stars: they then count as fewer observations.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.quest import AttitudeError, dcm, quest
from cubestack.firmware_model.attitude.robust_fit import HALF_CHI2, TAILS, AttitudeFit
from cubestack.firmware_model.mcu.costs import Meter

Floats = NDArray[np.float32]
Reals = NDArray[np.float64]
Rays = Callable[[Floats], Floats]  #: unit vectors (n, 3) of pixels (n, 2)

UNIT_PX = 512.0  #: distance from the principal point at which errors of the lens are given in px

FOCAL_PX = 15.0  #: usual size of a significant error of the focal length
FLOOR_PX = 0.02  #: error of a star's place beside its declared one (chosen)
CALM = 0.5  #: mean square of residuals, in declared variances, that needs no other lens
SHOWN = 10.0  #: sigmas that another principal point must be displaced by to be seen in residuals

#: Standard deviation across the boresight above which another lens is refused, in rad: three of
#: them are 0.1 deg.
LARGEST_SIGMA_RAD = 5.8e-4

WON = 0.9  #: probability from which on another lens is believed
ODDS = 20.0  #: of another principal point, below which the boresight stays as described
EXPLAINED = 1.5  #: spread up to which nothing is left to explain,
TESTED = 1.25  #: if there are this many coordinates of stars per fitted parameter
COMMON = 4.0  #: further observations that one star's unexplained error makes worthless (chosen)
UNEXPLAINED = 3.0  #: spread from which on errors count as unexplained
REST = 0.01  #: of a calibration's errors, the share that the nine do not describe (chosen)

ROUNDS = 3
POSSIBLE = 1e-3  #: probability from which on a lens is fitted again
SMALL_PX = 1.0  #: a step of the lens' errors after which another round changes nothing that counts

_PRIOR_DEGREES = 6.0  #: observations that the declared errors count for
_STEP_PX = np.float32(0.5)
_COUNT = 9  #: errors of the lens


@dataclass(frozen=True)
class LensErrors:
    """Usual sizes of a lens' errors in px, ``UNIT_PX`` from the principal point."""

    focal: float = 0.0  #: by the focal length
    shape: float = 0.0  #: by pixels that are wider than high, and by skew
    point: float = 0.0  #: of the principal point, along a row and along a column
    radial: float = 0.0  #: by distortion of third and of fifth order
    tangential: float = 0.0

    @property
    def sizes_px(self) -> Reals:
        """(9,) in the order of ``_fields``."""
        pair = self.shape, self.shape
        point, tangential = (self.point, self.point), (self.tangential, self.tangential)
        return np.array((self.focal, *pair, *point, self.radial, *tangential, self.radial))


@dataclass(frozen=True)
class LensModel:
    """A kind of lens."""

    sizes: LensErrors
    prior: float  #: probability before the picture
    is_other: bool = False  #: not the one described

    @property
    def columns(self) -> NDArray[np.intp]:
        """Errors that it has."""
        return np.flatnonzero(self.sizes.sizes_px)

    @property
    def moves_boresight(self) -> bool:
        return self.sizes.point > 0


def lenses(tolerance: LensErrors, focal_px: float = 0.0) -> tuple[LensModel, ...]:
    """Kinds of lenses, the described one first; all have a focal length that differs by
    ``focal_px`` at least. Probabilities are chosen."""
    tolerance = replace(tolerance, focal=max(tolerance.focal, focal_px))
    point, others = LensErrors(focal_px, point=tolerance.point), replace(tolerance, point=0.0)
    return (
        LensModel(LensErrors(focal_px), 0.3),
        LensModel(point, 0.25),
        LensModel(others, 0.1),
        LensModel(tolerance, 0.2),
        LensModel(replace(others, focal=FOCAL_PX, shape=13.0), 0.05, is_other=True),
        LensModel(replace(point, point=20.0), 0.04, is_other=True),
        LensModel(replace(tolerance, point=20.0), 0.03, is_other=True),
        LensModel(LensErrors(FOCAL_PX, 13.0, 20.0, 6.0, 3.0), 0.03, is_other=True),
    )


@dataclass(frozen=True, eq=False)
class LensVerdict:
    """The attitude that the stars support, whatever the lens."""

    quaternion: Floats  #: (4,), scalar last, reference to camera
    covariance: Floats  #: (3, 3) of the small rotation's error about the camera's axes, rad^2
    model: LensModel | None = None  #: the lens that is believed; None: as described
    error_px: Reals = field(default_factory=lambda: np.zeros(_COUNT))  #: fitted, as ``sizes_px``
    tolerated: float = 0.0  #: variance across the boresight by the tolerance alone, rad^2

    @property
    def is_refused(self) -> bool:
        """Whether it is another lens, and the boresight too uncertain for it."""
        across = max(self.covariance[0, 0], self.covariance[1, 1])
        is_uncertain = bool(across > LARGEST_SIGMA_RAD**2 + self.tolerated)
        return self.model is not None and self.model.is_other and is_uncertain


@dataclass(frozen=True, eq=False)
class _Fitted:
    """One lens, fitted."""

    model: LensModel
    rotation: Reals  #: (3, 3)
    error_px: Reals  #: (9,)
    covariance: Reals  #: of the rotation and the model's columns, by the residuals that are left
    squares: Reals  #: (n,) residuals in declared variances
    spread: float  #: variance of the residuals, of the declared one
    largest_step_px: float  #: of the errors, in the last round

    @property
    def is_tested(self) -> bool:
        """Whether more is observed than fitted, by a quarter at least."""
        return len(self.squares) * 2 >= TESTED * len(self.covariance)


def judge_lens(
    pixels: Floats,
    reference: Floats,
    sigmas: Floats,
    rays: Rays,
    centre: tuple[float, float],
    pixel_rad: float,
    fit: AttitudeFit,
    meter: Meter,
    tolerance: LensErrors | None,
) -> LensVerdict:
    """Judge a lens by identified stars.

    Args:
        pixels: (n, 2) places on the picture.
        reference: (n, 3) unit vectors of the catalogue.
        sigmas: (n,) declared errors in rad.
        rays: the lens as described.
        centre: column and row of its principal point.
        pixel_rad: angle that a pixel takes there.
        fit: of the same stars with that lens.
        meter: charged with every operation.
        tolerance: of its calibration; None: the lens is believed.
    """
    described = LensVerdict(fit.quaternion, fit.covariance)
    if tolerance is None:
        return described
    errors = np.hypot(sigmas.astype(float), FLOOR_PX * pixel_rad)
    if _agrees(pixels, errors, pixel_rad, fit, tolerance, meter):
        return described
    start = dcm(fit.quaternion, meter).astype(float)
    stars = _Stars(pixels, reference.astype(float), errors, rays, centre, pixel_rad, meter, start)
    fits = stars.fits(lenses(tolerance, 0.0 if fit.scale == 1.0 else FOCAL_PX))
    if not fits:
        return described
    common, shares = _shares(fits)
    chosen = _chosen(fits, shares)
    covariance = np.zeros((3, 3))
    for one, share in zip(fits, shares, strict=True):
        off = _small_turn(one.rotation @ chosen.rotation.T)
        wider = common * (1 + stars.rest(one))
        covariance += share * (one.covariance[:3, :3] * wider + np.outer(off, off))
    if not len(chosen.model.columns):
        covariance += fit.covariance * shares[[one is chosen for one in fits]].sum()
        return LensVerdict(fit.quaternion, covariance.astype(np.float32))
    try:
        quaternion = stars.attitude(chosen)
    except AttitudeError:
        return described
    tolerated = stars.variance(LensErrors(point=tolerance.point))
    return LensVerdict(
        quaternion, covariance.astype(np.float32), chosen.model, chosen.error_px, tolerated
    )


def _agrees(
    pixels: Floats,
    errors: Reals,
    pixel_rad: float,
    fit: AttitudeFit,
    tolerance: LensErrors,
    meter: Meter,
) -> bool:
    """Whether stars are where the lens as described puts them, and would not be with another
    principal point: its residuals are of second order in the field angle."""
    count = len(pixels)
    meter.charge(f32_mul=6 * count + 4, f32_add=8 * count, f32_div=2 * count + 3, f32_sqrt=2)
    freedom = 2 * count - 3 - (fit.scale != 1.0)
    calm = np.sum((fit.residuals / errors) ** 2) <= CALM * freedom
    angles2 = np.sum(np.var(pixels, axis=0)) * pixel_rad**2
    error_px = np.sqrt(np.mean(errors**2) / count) / pixel_rad
    return bool(calm and tolerance.point * angles2 > SHOWN * error_px)


def _shares(fits: list[_Fitted]) -> tuple[float, Reals]:
    """Observations that one star's error makes worthless, itself among them, and the probability
    of each lens."""
    common = 1 + COMMON * (1 - 1 / max(1.0, min(one.spread for one in fits) / UNEXPLAINED))
    logs = np.array([_evidence(one, common) for one in fits])
    shares = np.exp(logs - logs.max())
    return common, shares / shares.sum()


def _chosen(fits: list[_Fitted], shares: Reals) -> _Fitted:
    """The lens that is believed, of those with these probabilities. A principal point counts only
    where it explains the residuals: what a smooth displacement leaves looks like one, too."""
    other = np.array([one.model.is_other for one in fits])
    moving = np.array([one.model.moves_boresight for one in fits])
    explained = np.array([one.spread < EXPLAINED and one.is_tested for one in fits])
    believed = shares.copy()
    if shares[other].sum() >= WON:
        believed[~other] = 0
    else:
        believed[other] = 0
        still, moved = believed[~moving].sum(), believed[moving & explained].sum()
        believed[moving if still * ODDS > moved else ~(moving & explained)] = 0
    return fits[int(believed.argmax())]


@dataclass(eq=False)
class _Stars:
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
        return _fields(self.pixels, self.centre)

    @cached_property
    def _first(self) -> "_Equations":
        """The equations of all errors, from the start."""
        design, apart = self._linear(self.start, np.zeros(_COUNT))
        squares = np.sum(apart * apart, axis=1) / self.sigmas**2
        spread = max(1.0, float(np.median(squares)) / 2 / HALF_CHI2)
        return self._equations(design, apart, _weights(squares, spread))

    def fits(self, models: tuple[LensModel, ...]) -> list[_Fitted]:
        """The lenses fitted from the start; those that are possible then, from where they are."""
        found = [self.fit(model) for model in models]
        for _ in range(ROUNDS - 1):
            _, shares = _shares(found)
            again = [
                place
                for place, one in enumerate(found)
                if shares[place] > POSSIBLE and one.largest_step_px > SMALL_PX
            ]
            if not again:
                break
            for place in again:
                found[place] = self.fit(found[place].model, found[place])
        return found

    def fit(self, model: LensModel, last: _Fitted | None = None) -> _Fitted:
        """A lens fitted from the start, or from its last fit. Stars far from their places weigh
        less, as in ``robust_fit``."""
        columns = model.columns
        usual = model.sizes.sizes_px[columns]
        every = np.concatenate([np.arange(3), 3 + columns])
        rotation, error_px, spread, equations = self.start, np.zeros(_COUNT), 1.0, self._first
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
        return _Fitted(
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

    def rest(self, fitted: _Fitted) -> float:
        """Variance of what a fit leaves in a lens of the tolerance, of the stars' own."""
        if fitted.model.is_other:
            return 0.0
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
        turns = [np.cross(axis, predicted) for axis in np.eye(3)]
        design = [*turns, *(self._fields[..., :1] * across + self._fields[..., 1:] * down)]
        return np.array(design), self.rays(pixels).astype(float) - predicted

    def _equations(self, design: Reals, apart: Reals, weights: Reals) -> "_Equations":
        """The normal equations; ``rays`` charge themselves."""
        rows, count = len(design), len(apart)
        scale = (np.sqrt(weights) / self.sigmas)[:, None]
        scaled, wanted = (design * scale).reshape(rows, -1), (apart * scale).reshape(-1)
        products = count * (3 * rows * (rows + 3) // 2 + 6 * _COUNT + 9)
        self.meter.charge(f32_mul=products, f32_add=products, f32_div=count, loop=count * rows)
        return _Equations(design, apart, weights, scaled @ scaled.T, scaled @ wanted)

    def attitude(self, fitted: _Fitted) -> Floats:
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
        """Cholesky's factors, solution, trace of the inverse, residuals and weights."""
        columns, count = 3 + size, len(self.pixels)
        solved = columns**3 // 3 + 2 * columns**2 + count * (3 * columns + 6)
        self.meter.charge(
            f32_mul=solved, f32_add=solved, f32_div=columns + 2 * count, f32_sqrt=columns
        )


@dataclass(frozen=True, eq=False)
class _Equations:
    """What changes the stars' directions, and how much."""

    design: Reals  #: (12, n, 3) by a turn about each axis in rad, and by 1 px of each error
    apart: Reals  #: (n, 3) what is left to explain
    weights: Reals  #: (n,) of the stars, at most 1
    known: Reals  #: (12, 12) information about them
    told: Reals  #: (12,)


def _fields(pixels: Floats, centre: tuple[float, float]) -> Reals:
    """Displacements (9, n, 2) of the stars' places for an error of 1 px each, as ``sizes_px``."""
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
        (r2 * r2 * x, r2 * r2 * y),
    ]
    return np.array(fields, float).transpose(0, 2, 1)


def _weights(squares: Reals, spread: float) -> Reals:
    return np.minimum((TAILS + 2) / (TAILS + squares / spread), 1)


def _spread(squares: Reals, weights: Reals, fitted: float) -> float:
    """Variance of the residuals, of the declared one, at least 1; ``fitted`` parameters."""
    freedom = max(2 * len(squares) - fitted, 0.0)
    return max(1.0, float((_PRIOR_DEGREES + weights @ squares) / (_PRIOR_DEGREES + freedom)))


def _evidence(fitted: _Fitted, common: float) -> float:
    """Logarithm of the probability of a lens, up to a constant; see the module."""
    model, spread = fitted.model, fitted.spread
    observations = 2 * len(fitted.squares) - 3 + _PRIOR_DEGREES
    likelihood = -(TAILS + 2) / 2 * np.log1p(fitted.squares / spread / TAILS).sum()
    log = np.log(model.prior) + (likelihood - observations / 2 * np.log(spread)) / common
    if len(model.columns):
        usual, errors = model.sizes.sizes_px[model.columns], fitted.error_px[model.columns]
        log -= float(np.sum((errors / usual) ** 2)) / 2
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
