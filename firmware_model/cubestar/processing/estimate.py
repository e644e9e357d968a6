"""The attitude from identified stars: weighted with votes, or with the stars' expected errors.

Inverse squares of the expected errors are the weights of least variance (Shuster and Oh 1981), and
with the residuals they give the covariance. Errors that all stars share leave no residual:
aberration of light, up to 1e-4 rad, is left to users that know the velocity.

Telemetry Quality rates it, or says why there is none. What disturbs the picture comes first
(``star_tracker.quality``); only an undisturbed picture is said to have too few stars. The limits
are chosen well above those of an undisturbed sky.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import (
    CameraParameters,
    scaled,
    undistort,
    unit_vectors,
)
from cubestack.firmware_model.attitude.lens_doubt import judge_lens
from cubestack.firmware_model.attitude.lens_models import LensErrors
from cubestack.firmware_model.attitude.quest import quest
from cubestack.firmware_model.attitude.robust_fit import robust_fit
from cubestack.firmware_model.cubestar.detection.contract import Detection
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.processing.identify import Results
from cubestack.firmware_model.cubestar.state import UNRATED
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.cubestar.codes import Reason
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.quality import DisturbanceLimits, Rating
from cubestack.firmware_model.star_tracker.search import MatchOutcome

CENTROID_ERROR_PX = 0.2  #: of a search without error estimates

#: Difference of the focal length from the one that is set, from which on the identification's
#: estimate of it counts; below, it is left to the fit.
SCALED = 2e-3

#: How much residuals beyond the expected errors count: chosen so that the claimed sigmas hold with
#: lens residuals, defocus, uneven response and hot pixels, which move neighbouring stars alike.
EXCESS = 2.2

#: What the calibration leaves open: of the principal point, a third of the 13 and 15 px of figure
#: 5.12, which prints three standard deviations. It does not say in which direction its coefficients
#: map; with the other one, distortion of both orders differs by several px.
TOLERANCE = LensErrors(focal=0.7, shape=0.3, point=4.8, radial=4.0, tangential=0.5)


@dataclass(frozen=True, eq=False)
class Estimate:
    """An attitude (4,), its number of stars, and its rating, if any."""

    quaternion: NDArray[np.float32]
    stars: int
    rating: Rating | None
    is_refused: bool = False  #: the lens is not as described, and the attitude too uncertain


def by_votes(
    results: Results,
    identification: Identification,
    vectors: NDArray[np.float32],
    meter: Meter,
    *,
    rotated: bool = True,
) -> Estimate:
    """As published; ``vectors`` are the catalogue's (m, 3), ``rotated`` as in ``quest``. Raises
    AttitudeError."""
    kept = identification.matched
    inertial = vectors[identification.stars[kept]]
    weights = identification.votes[kept].astype(np.float32)
    measured = scaled(results.vectors[kept], 1 / identification.scale, meter)
    return Estimate(quest(measured, inertial, weights, meter, rotated=rotated), len(kept), None)


def by_errors(
    results: Results,
    identification: Identification,
    vectors: NDArray[np.float32],
    camera: CameraParameters,
    meter: Meter,
    *,
    accuracy: NDArray[np.float32] | None = None,
) -> Estimate:
    """Weighted with inverse variances, displaced stars less, rated, and with the lens that the
    stars support. Raises AttitudeError. ``accuracy`` (m,): of the catalogue's ``vectors`` in rad,
    if they have errors."""
    kept, detection = identification.matched, results.detection
    scale = identification.scale if abs(identification.scale - 1) > SCALED else 1.0
    inertial, sigmas = (
        vectors[identification.stars[kept]],
        expected_errors(results, kept, camera, meter),
    )
    if accuracy is not None:
        sigmas = np.hypot(sigmas, accuracy[identification.stars[kept]])
        meter.charge(f32_mul=2 * len(kept), f32_add=len(kept), f32_sqrt=len(kept))
    fit = robust_fit(results.vectors[kept], inertial, sigmas, meter, scale=scale, excess=EXCESS)
    meter.charge(flash_read=3 * len(kept))
    refused = False
    if detection is not None:
        lens = judge_lens(
            detection.centroids[kept],
            inertial,
            sigmas,
            lambda pixels: unit_vectors(undistort(pixels, camera, meter), camera, meter),
            (camera.cx, camera.cy),
            camera.pitch_mm / camera.focal_length_mm,
            fit,
            meter,
            TOLERANCE,
        )
        refused = lens.is_refused
        fit = replace(fit, quaternion=lens.quaternion, covariance=lens.covariance)
    rating = Rating.of(fit, identification.false_alarm, meter)
    return Estimate(fit.quaternion, len(kept), rating, refused)


def expected_errors(
    results: Results,
    kept: NDArray[np.intp],
    camera: CameraParameters,
    meter: Meter,
    *,
    unknown_px: float = CENTROID_ERROR_PX,
) -> NDArray[np.float32]:
    """Expected error (k,) of each star's direction in each axis, in rad; ``unknown_px`` is that of
    a search without error estimates."""
    count = len(kept)
    errors = np.full(count, unknown_px, np.float32)
    if results.detection is not None and len(results.detection.errors_px):
        errors = results.detection.errors_px[kept]
    pixel_rad = np.float32(camera.pitch_mm) / np.float32(camera.focal_length_mm)
    meter.charge(f32_mul=3 * count, f32_sqrt=count, f32_div=1, loop=count)
    # A pixel is smaller the further it is from the boresight: in the mean of both axes by z^1.5.
    z = results.vectors[kept, 2]
    return np.asarray(pixel_rad * z * np.sqrt(z) * errors, np.float32)


#: The brightest stars fill a few pixels each, and 1e-3 are 500; brightness and differences are more
#: than noise feigns. Emulated skies below these limits are solved.
LIMITS = DisturbanceLimits(
    saturated=1e-3, background=40.0, background_range=15.0, enough=20, blind=0.3, spikes=20_000
)

STREAKS = 3
ALIGNED = 0.6  #: share of all areas that are drawn out in the same way, as of a turning camera
TRACKS = 15  #: areas drawn out in directions of their own; a limb's pieces are beside a large area

_OTHERS = {
    MatchOutcome.TOO_FEW_CENTROIDS: Reason.TOO_FEW_STARS,
    MatchOutcome.TOO_FEW_MATCHED: Reason.UNCONFIRMED,
}


def reason_of(detection: Detection | None, outcome: MatchOutcome) -> Reason:
    """Why an identification ended with ``outcome``: what disturbed the picture, if its search
    measured that and it explains the failure."""
    picture = None if detection is None else detection.statistics
    if detection is not None and picture is not None:
        disturbance = LIMITS.exceeded(
            picture,
            len(detection.centroids),
            smear=picture.elongated >= STREAKS and picture.aligned >= ALIGNED,
            tracks=picture.elongated >= TRACKS and not picture.large,
        )
        if disturbance is not None:
            return Reason[disturbance.name]
    return _OTHERS[outcome] if outcome in _OTHERS else Reason[outcome.name]


def picture_values(results: Results, reason: Reason) -> dict[str, Value]:
    """Values of a picture that gave no attitude for ``reason``."""
    values = UNRATED | {"FrameCounter": results.frame, "Reason": reason}
    picture = None if results.detection is None else results.detection.statistics
    if picture is not None:
        values |= {
            "Background": picture.background,
            "BackgroundRange": picture.background_range,
            "Noise": picture.noise,
            "Saturated": picture.saturated,
            "Spikes": picture.spikes,
            "Elongated": picture.elongated,
        }
    return values


def rated(
    results: Results, identification: Identification, rating: Rating, reason: Reason
) -> dict[str, Value]:
    """Values of a picture that gave an attitude; it is valid if ``reason`` says SOLVED."""
    valid, matched = reason is Reason.SOLVED, len(identification.matched)
    return picture_values(results, reason) | rating.values(
        matched, identification.expected, valid=valid
    )
