"""CubeSense's fisheye lens: directions to pixels and back, and the directions of all pixels.

CubeSense thesis, section 5.1.1 (boresight, table 5.1), section 5.2.1 (2.9 px per degree of field
angle, equation 5.2.1, and the measured distortion polynomial, equation 5.2.3) and appendix A.3
(field of 190 deg). By the polynomial, the field ends 226.6 px from the boresight; in table 5.1 the
rim is at 226 px. The lens of a unit may differ: `lens_error`.

Equation 5.2.3 results in 0.10 px at field angle 0; points within that radius count as the
boresight.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.camera.common.residual import displace, restore
from cubestack.emulator.camera.ov7620.lens_error import FIELD_DEG, NOMINAL, LensError
from cubestack.emulator.scene.attitude import angles_from_vector, vector_from_angles
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.emulator.scene.file import SceneError
from cubestack.firmware_model.interface.cameras.ov7620 import COLUMNS, ROWS

DISTORTION = (-2.5572e-6, 7.6076e-5, 0.9953, 0.1036)
"""Coefficients of equation 5.2.3, highest power first; radii in px."""

PIXELS_PER_DEGREE = 2.9
"""Undistorted pixels per degree of field angle."""

_NEWTON_STEPS = 8


def check_field(alpha_deg: float, beta_deg: float) -> None:
    """Raise SceneError for angles of a reflection outside the field."""
    if not np.hypot(alpha_deg, beta_deg) <= FIELD_DEG:
        raise SceneError(
            f"at_deg must be within {FIELD_DEG} deg of the boresight, not {alpha_deg}, {beta_deg}"
        )


def distort(radius_px: ArrayLike) -> NDArray[np.float64]:
    """Distance from the boresight in the image for the ideal ``radius_px`` (equation 5.2.3).

    Monotonic up to 370 px, far beyond the field's 275.5 px.
    """
    return np.asarray(np.polyval(DISTORTION, np.asarray(radius_px, np.float64)))


def undistort(radius_px: ArrayLike) -> NDArray[np.float64]:
    """Inverse of `distort` within the field, exact; 0 below its smallest value."""
    target = np.asarray(radius_px, np.float64)
    radius = np.minimum(target, distort(FIELD_DEG * PIXELS_PER_DEGREE))
    slope = np.polyder(DISTORTION)
    for _ in range(_NEWTON_STEPS):
        radius = radius - (distort(radius) - target) / np.polyval(slope, radius)
    return np.maximum(radius, 0)


@dataclass(frozen=True)
class Fisheye:
    """One camera's lens. Pixel coordinates have (0, 0) at the first pixel's centre."""

    # boresight and centre of distortion, px
    cx: float
    cy: float
    # deviation from the polynomial; ``cx`` and ``cy`` already contain that of the centre
    error: LensError = NOMINAL

    def project(self, vector: ArrayLike) -> NDArray[np.float64] | None:
        """Pixel coordinates (2,) of a direction (3,) in camera axes; None outside the field."""
        angles = np.array(angles_from_vector(vector))
        if np.hypot(*angles) > FIELD_DEG:
            return None
        angles = self.error.displace(angles)
        theta = float(np.hypot(*angles))
        stretch = self.error.scale * distort(theta * PIXELS_PER_DEGREE) / theta if theta else 0.0
        pixels = np.array([[self.cx, self.cy]]) + angles * stretch
        return np.asarray(displace(pixels, self.error.residuals)[0])

    def unproject(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Unit vectors (n, 3) in camera axes of pixel coordinates (n, 2) within the field."""
        points = restore(np.asarray(pixels, np.float64), self.error.residuals)
        offset = (points - (self.cx, self.cy)) / self.error.scale
        radius = np.hypot(offset[:, 0], offset[:, 1])
        theta = undistort(radius) / PIXELS_PER_DEGREE
        angles = self.error.restore(offset * (theta / np.where(radius == 0, 1, radius))[:, None])
        return vector_from_angles(angles[:, 0], angles[:, 1])

    @cached_property
    def field(self) -> "FieldOfView":
        """Directions of all pixels within the field.

        The size of a pixel is that of the polynomial; an error changes it by a few percent.
        """
        rows, columns = np.mgrid[:ROWS, :COLUMNS].reshape(2, -1)
        radius = np.hypot(columns - self.cx, rows - self.cy) / self.error.scale
        rim = float(distort(FIELD_DEG * PIXELS_PER_DEGREE))
        lit = np.clip(rim - radius + 0.5, 0, 1)
        index = np.flatnonzero(lit)
        wide = undistort(np.minimum(radius[index], rim))
        # Across the radius a pixel spans 1 / radius of a turn; along it, the inverse of the slope.
        along = 1 / np.polyval(np.polyder(DISTORTION), wide)
        across = np.sin(np.radians(wide / PIXELS_PER_DEGREE)) / np.maximum(radius[index], 1)
        along_rad = np.radians(along / PIXELS_PER_DEGREE)
        across_rad = np.where(radius[index] < 1, along_rad, across)
        return FieldOfView(
            index,
            self.unproject(np.stack([columns[index], rows[index]], axis=1)).astype(np.float32),
            np.sqrt(along_rad * across_rad).astype(np.float32),
            lit[index].astype(np.float32),
        )


@dataclass(frozen=True, eq=False)
class FieldOfView:
    """The pixels within a lens' field, in the order of the image."""

    index: NDArray[np.int64]  # flat indices (n,) in the image of 480 rows of 640
    vectors: NDArray[np.float32]  # unit vectors (n, 3) in camera axes, float32
    # angle (n,) that a pixel spans, the mean of both directions, float32
    pixel_rad: NDArray[np.float32]
    # share (n,) of each pixel within the field; below 1 only along the rim, float32
    lit: NDArray[np.float32]


LENSES = {CameraTarget.SUN: Fisheye(369, 250), CameraTarget.NADIR: Fisheye(371, 236)}
"""Boresight of each camera (table 5.1)."""


@lru_cache(maxsize=8)
def lens_of(camera: CameraTarget, error: LensError = NOMINAL) -> Fisheye:
    """The lens of ``camera`` with ``error``; cached, as computing its field takes time."""
    if error == NOMINAL:
        return LENSES[camera]
    (x, y), nominal = error.centre_px, LENSES[camera]
    return Fisheye(nominal.cx + x, nominal.cy + y, error)
