"""The attitude from identified stars: weighted with votes, or with the stars' expected errors.

Inverse squares of the expected errors are the weights of least variance (Shuster and Oh 1981), and
with the residuals they give the covariance. Errors that all stars share leave no residual:
aberration of light, up to 1e-4 rad, is left to users that know the velocity.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import CameraParameters, scaled
from cubestack.firmware_model.attitude.quest import quest
from cubestack.firmware_model.attitude.robust_fit import robust_fit
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.processing.identify import Results
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.quality import Rating

CENTROID_ERROR_PX = 0.2  #: of a search without error estimates

#: Difference of the focal length from the one that is set, from which on the identification's
#: estimate of it counts; below, it is left to the fit.
SCALED = 2e-3

#: How much residuals beyond the expected errors count: chosen so that the claimed sigmas hold with
#: lens residuals, defocus, uneven response and hot pixels, which move neighbouring stars alike.
EXCESS = 2.2


@dataclass(frozen=True, eq=False)
class Estimate:
    """An attitude (4,), its number of stars, and its rating, if any."""

    quaternion: NDArray[np.float32]
    stars: int
    rating: Rating | None


def by_votes(
    results: Results, identification: Identification, vectors: NDArray[np.float32], meter: Meter
) -> Estimate:
    """As published; ``vectors`` are the catalogue's (m, 3). Raises AttitudeError."""
    kept = identification.matched
    inertial = vectors[identification.stars[kept]]
    weights = identification.votes[kept].astype(np.float32)
    measured = scaled(results.vectors[kept], 1 / identification.scale, meter)
    return Estimate(quest(measured, inertial, weights, meter), len(kept), None)


def by_errors(
    results: Results,
    identification: Identification,
    vectors: NDArray[np.float32],
    camera: CameraParameters,
    meter: Meter,
) -> Estimate:
    """Weighted with inverse variances, displaced stars less, and rated. Raises AttitudeError."""
    kept = identification.matched
    scale = identification.scale if abs(identification.scale - 1) > SCALED else 1.0
    fit = robust_fit(
        results.vectors[kept],
        vectors[identification.stars[kept]],
        _sigmas(results, kept, camera, meter),
        meter,
        scale=scale,
        excess=EXCESS,
    )
    meter.charge(flash_read=3 * len(kept))
    rating = Rating.of(fit, identification.false_alarm, meter)
    return Estimate(fit.quaternion, len(kept), rating)


def _sigmas(
    results: Results, kept: NDArray[np.intp], camera: CameraParameters, meter: Meter
) -> NDArray[np.float32]:
    """Expected error (k,) of each star's direction in each axis, in rad."""
    count = len(kept)
    errors = np.full(count, CENTROID_ERROR_PX, np.float32)
    if results.detection is not None and len(results.detection.errors_px):
        errors = results.detection.errors_px[kept]
    pixel_rad = np.float32(camera.pitch_mm) / np.float32(camera.focal_length_mm)
    meter.charge(f32_mul=3 * count, f32_sqrt=count, f32_div=1, loop=count)
    # A pixel is smaller the further it is from the boresight: in the mean of both axes by z^1.5.
    z = results.vectors[kept, 2]
    return np.asarray(pixel_rad * z * np.sqrt(z) * errors, np.float32)
