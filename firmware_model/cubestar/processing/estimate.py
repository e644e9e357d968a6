"""The attitude from identified stars: weighted with votes, or with what their errors will be.

The expected error of a star is that of its centroid, which the search tells, and of its place in
catalogue and lens. Its inverse square is the weight of least variance (Shuster and Oh 1981), and
with the residuals it gives the covariance of the attitude.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.confirmation import scaled
from cubestack.firmware_model.attitude.covariance import covariance
from cubestack.firmware_model.attitude.geometry import CameraParameters
from cubestack.firmware_model.attitude.quest import dcm, quest
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.processing.quality import Rating
from cubestack.firmware_model.cubestar.processing.results import Results
from cubestack.firmware_model.mcu.costs import Meter

PLACE_ERROR_PX = 0.05
"""Error of a star's place that no light could lessen: lens after calibration, proper motion,
uneven response; one sigma in each axis."""

CENTROID_ERROR_PX = 0.2
"""Of a search that does not tell what errors to expect."""

FLOOR_RAD = (2e-5, 2e-5, 3e-5)
"""One sigma about x, y and z of errors that all stars share, so that no residual shows them:
the mean of the lens' errors over few stars, the time of mid-exposure. Aberration of light is not in
it: it turns all directions by up to 1e-4 rad, and whoever knows the velocity corrects it."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """An attitude (4,), its stars in number, and what is known of its error, if anything."""

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
    """Weighted with the inverse variances, and rated. Raises AttitudeError."""
    kept = identification.matched
    measured = scaled(results.vectors[kept], 1 / identification.scale, meter)
    inertial = vectors[identification.stars[kept]]
    sigmas = _sigmas(results, kept, measured, camera, meter)
    quaternion = quest(measured, inertial, np.float32(1) / (sigmas * sigmas), meter)
    apart = measured - inertial @ dcm(quaternion, meter).T
    squares = np.sum(apart * apart, axis=1)
    count = len(kept)
    meter.charge(
        f32_mul=(9 + 3 + 1) * count,
        f32_add=(6 + 3 + 3) * count,
        f32_div=count + 1,
        f32_sqrt=count + 1,
        loop=count,
        flash_read=3 * count,
    )
    claimed = covariance(measured, np.sqrt(squares), sigmas, meter, floor=FLOOR_RAD)
    residual = float(np.sqrt(squares.sum() / max(2 * count - 3, 1)))
    return Estimate(quaternion, count, Rating(claimed, residual))


def _sigmas(
    results: Results,
    kept: NDArray[np.intp],
    measured: NDArray[np.float32],
    camera: CameraParameters,
    meter: Meter,
) -> NDArray[np.float32]:
    """Expected error (k,) of each star's direction in each axis, in rad."""
    count = len(kept)
    errors = np.full(count, CENTROID_ERROR_PX, np.float32)
    if results.detection is not None and len(results.detection.errors_px):
        errors = results.detection.errors_px[kept]
    pixel_rad = np.float32(camera.pitch_mm) / np.float32(camera.focal_length_mm)
    meter.charge(f32_mul=4 * count, f32_add=count, f32_sqrt=count, f32_div=1, loop=count)
    # A pixel is smaller the further it is from the boresight: in the mean of both axes by z^1.5.
    shrunk = pixel_rad * measured[:, 2] * np.sqrt(measured[:, 2])
    return np.asarray(shrunk * np.sqrt(errors**2 + np.float32(PLACE_ERROR_PX) ** 2), np.float32)
