"""Whether the stars of a picture agree with the lens that is described, and what follows if not.

Residuals within the stars' declared errors leave the description as it is. Otherwise the attitude
is fitted together with nine errors of the lens: focal length, shape of the pixels (fx and fy that
differ, skew), principal point, distortion. Lenses differ in how large each error usually is:

- the lens as described, whose stars are displaced by something else;
- a lens within the tolerance of its calibration, with and without another principal point;
- a lens that is not the one described: rare, and with errors far beyond the tolerance.

Refused is only another lens that has won, if the mixture of all lenses by their probabilities
leaves the boresight uncertain. A tolerance refuses nothing: it widens the claim (``lens_claim``).
"""

from dataclasses import dataclass, field

import numpy as np

from cubestack.firmware_model.attitude.lens_claim import claimed_covariance
from cubestack.firmware_model.attitude.lens_evidence import Evidence, evidence, fitted_lenses
from cubestack.firmware_model.attitude.lens_fit import FittedLens, LensStars, Rays, small_turn
from cubestack.firmware_model.attitude.lens_models import (
    COUNT,
    DESCRIBED,
    FOCAL_PX,
    Floats,
    LensErrors,
    LensModel,
    Reals,
    lenses,
)
from cubestack.firmware_model.attitude.quest import AttitudeError, dcm
from cubestack.firmware_model.attitude.robust_fit import AttitudeFit
from cubestack.firmware_model.mcu.costs import Meter

FLOOR_PX = 0.02  #: error of a star's place beside its declared one (chosen)
CALM = 0.5  #: mean square of residuals, in declared variances, that needs no other lens
SHOWN = 10.0  #: sigmas that another principal point must be displaced by to be seen in residuals

#: Standard deviation across the boresight above which another lens is refused, in rad: three of
#: them are 0.1 deg.
LARGEST_SIGMA_RAD = 5.8e-4
STILL = 2.0  #: factor of the tolerance's variance beside it, for a lens that keeps its boresight

CONTRADICTED = 80.0  #: spread with another focal length from which on nothing is known
WON = 0.9  #: probability from which on another lens is believed
ODDS = 1000.0  #: of another principal point, below which the boresight stays as described


@dataclass(frozen=True, eq=False)
class LensVerdict:
    """The attitude that the stars support, whatever the lens."""

    quaternion: Floats  #: (4,), scalar last, reference to camera
    covariance: Floats  #: (3, 3) of the small rotation's error about the camera's axes, rad^2
    model: LensModel | None = None  #: the lens that is believed; None: as described
    error_px: Reals = field(default_factory=lambda: np.zeros(COUNT))  #: fitted, as ``sizes_px``
    across: float = 0.0  #: larger variance across the boresight by the lenses' probabilities, rad^2
    tolerated: float = 0.0  #: the same by the tolerance alone
    contradicts: bool = False  #: a significant focal length that explains little

    @property
    def is_refused(self) -> bool:
        """Whether it is another lens, and either not known or the boresight too uncertain."""
        if self.model is None or not self.model.is_other:
            return self.contradicts
        tolerated = self.tolerated * (1.0 if self.model.moves_boresight else STILL)
        return self.contradicts or self.across > LARGEST_SIGMA_RAD**2 + tolerated


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
    stars = LensStars(
        pixels, reference.astype(float), errors, rays, centre, pixel_rad, meter, start
    )
    fits = fitted_lenses(stars, lenses(tolerance, 0.0 if fit.scale == 1.0 else FOCAL_PX))
    found = evidence(fits, meter)
    chosen = _chosen(fits, found.probabilities)
    if not len(chosen.model.columns):
        claimed = claimed_covariance(stars, fits, found, chosen, start)
        return LensVerdict(fit.quaternion, claimed.astype(np.float32))
    try:
        quaternion = stars.attitude(chosen)
    except AttitudeError:
        return described
    reported = dcm(quaternion, meter).astype(float)
    return LensVerdict(
        quaternion,
        claimed_covariance(stars, fits, found, chosen, reported).astype(np.float32),
        chosen.model,
        chosen.error_px,
        _across(stars, fits, found, chosen),
        stars.variance(LensErrors(point=tolerance.point)),
        contradicts=chosen is fits[DESCRIBED] and chosen.spread > CONTRADICTED,
    )


def _across(stars: LensStars, fits: list[FittedLens], found: Evidence, chosen: FittedLens) -> float:
    """Larger variance across the boresight, about the attitude of the lens that is believed."""
    stars.meter.charge(f32_mul=10 * len(fits), f32_add=8 * len(fits), loop=len(fits))
    across = np.zeros(2)
    for one, share in zip(fits, found.probabilities, strict=True):
        off = small_turn(one.rotation @ chosen.rotation.T)[:2]
        wider = found.common * (1 + stars.rest(one))
        across += share * (np.diag(one.covariance)[:2] * wider + off * off)
    return float(across.max())


def _agrees(
    pixels: Floats,
    errors: Reals,
    pixel_rad: float,
    fit: AttitudeFit,
    tolerance: LensErrors,
    meter: Meter,
) -> bool:
    """Whether stars are where the lens as described puts them, focal length included, and would
    not be with another principal point: its residuals are of second order in the field angle."""
    if fit.scale != 1.0:
        return False
    count = len(pixels)
    meter.charge(f32_mul=6 * count + 4, f32_add=8 * count, f32_div=2 * count + 3, f32_sqrt=2)
    calm = np.sum((fit.residuals / errors) ** 2) <= CALM * (2 * count - 3)
    angles2 = np.sum(np.var(pixels, axis=0)) * pixel_rad**2
    error_px = np.sqrt(np.mean(errors**2) / count) / pixel_rad
    return bool(calm and tolerance.point * angles2 > SHOWN * error_px)


def _chosen(fits: list[FittedLens], shares: Reals) -> FittedLens:
    """The lens that is believed, of those with these probabilities. A principal point counts only
    where it explains the residuals: what a smooth displacement leaves looks like one, too."""
    other = np.array([one.model.is_other for one in fits])
    moving = np.array([one.model.moves_boresight for one in fits])
    explained = np.array([one.explains for one in fits])
    believed = shares.copy()
    if shares[other].sum() >= WON:
        believed[~other] = 0
    else:
        believed[other] = 0
        still, moved = believed[~moving].sum(), believed[moving & explained].sum()
        believed[moving if still * ODDS > moved else ~(moving & explained)] = 0
    return fits[int(believed.argmax())]
