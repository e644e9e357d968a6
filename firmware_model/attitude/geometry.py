"""From centroids on the picture to unit vectors, in single precision.

CubeStar thesis, section 4.1.4 (Brown's distortion model, equations 4.1.3 to 4.1.5), section 4.1.5
(equation 4.1.6) and figure 5.12 (calibration). Camera axes are x right, y down, z out of the lens;
an integer pixel coordinate is a pixel's centre. The radius is formed from the normalised x and y:
with the pixel distances that the thesis prints for it, the coefficients would make no sense.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.float_functions import arc_tangent, cosine, sine
from cubestack.firmware_model.interface.cameras.mlx75412 import PIXEL_PITCH_MM
from cubestack.firmware_model.mcu.costs import Meter

_ONE = np.float32(1)
_TWO = np.float32(2)


class CameraParameterError(ValueError):
    """A camera parameter with which no direction can be computed."""


@dataclass(frozen=True)
class CameraParameters:
    """Calibration of camera and lens, as telecommands 8 to 12 load it."""

    focal_length_mm: float  #: focal length of the pinhole in mm
    #: focal length in px with which distortion coordinates are normalised
    fx: float
    fy: float
    #: principal point and distortion centre in px
    cx: float
    cy: float
    #: radial coefficients, distorted to undistorted
    k1: float
    k2: float
    #: tangential coefficients, distorted to undistorted
    p1: float
    p2: float
    pitch_mm: float = PIXEL_PITCH_MM  #: distance of pixel centres in mm, the same in x and y

    def __post_init__(self) -> None:
        for name in ("focal_length_mm", "fx", "fy", "pitch_mm"):
            value = getattr(self, name)
            if not value > 0:
                raise CameraParameterError(f"{name} must be above 0, not {value}")


def undistort(
    centroids: NDArray[np.float32], camera: CameraParameters, meter: Meter
) -> NDArray[np.float32]:
    """Undistorted image points in px, (n, 2), of measured ones (n, 2); both as columns x, y."""
    fx, fy, cx, cy = (np.float32(v) for v in (camera.fx, camera.fy, camera.cx, camera.cy))
    k1, k2, p1, p2 = (np.float32(v) for v in (camera.k1, camera.k2, camera.p1, camera.p2))
    points = centroids.astype(np.float32, copy=False)
    x = (points[:, 0] - cx) / fx
    y = (points[:, 1] - cy) / fy
    xx, yy, xy = x * x, y * y, x * y
    r2 = xx + yy
    radial = _ONE + k1 * r2 + k2 * (r2 * r2)
    x_u = x * radial + p2 * (r2 + _TWO * xx) + _TWO * p1 * xy
    y_u = y * radial + p1 * (r2 + _TWO * yy) + _TWO * p2 * xy
    count = len(points)
    meter.charge(f32_add=13 * count, f32_mul=16 * count + 2, f32_div=2 * count, loop=count)
    return np.stack([cx + fx * x_u, cy + fy * y_u], axis=1)


def unit_vectors(
    points: NDArray[np.float32], camera: CameraParameters, meter: Meter
) -> NDArray[np.float32]:
    """Unit vectors (n, 3) in camera axes of undistorted image points (n, 2) in px."""
    scale = np.float32(camera.pitch_mm) / np.float32(camera.focal_length_mm)
    x = (points[:, 0] - np.float32(camera.cx)) * scale
    y = (points[:, 1] - np.float32(camera.cy)) * scale
    z = _ONE / np.sqrt(_ONE + x * x + y * y)
    count = len(points)
    meter.charge(
        f32_add=4 * count, f32_mul=6 * count, f32_div=count + 1, f32_sqrt=count, loop=count
    )
    return np.stack([x * z, y * z, z], axis=1)


def direction_of(right_ascension: float, declination: float, meter: Meter) -> NDArray[np.float32]:
    """Unit vector (3,) of a right ascension and a declination in rad."""
    angles = np.array([right_ascension, declination], np.float32)
    (cos_ra, along), (sin_ra, sin_dec) = cosine(angles), sine(angles)
    meter.charge(f32_sin=4, f32_mul=2)
    return np.array([along * cos_ra, along * sin_ra, sin_dec], dtype=np.float32)


def angles_of(direction: NDArray[np.float32], meter: Meter) -> tuple[float, float]:
    """Right ascension in rad, -pi to pi, and declination in rad of a unit vector (3,)."""
    x, y, z = direction.astype(np.float32)
    meter.charge(f32_atan2=2, f32_mul=2, f32_add=1, f32_sqrt=1)
    return float(arc_tangent(y, x)), float(arc_tangent(z, np.sqrt(x * x + y * y)))


def turned(vectors: NDArray[np.float32], dcm: NDArray[np.float32]) -> NDArray[np.float32]:
    """Vectors (n, 3) in the axes that a direction cosine matrix (3, 3) leads to; not charged."""
    product: NDArray[np.float32] = (
        vectors[:, :1] * dcm[:, 0] + vectors[:, 1:2] * dcm[:, 1] + vectors[:, 2:] * dcm[:, 2]
    )
    return product


def scaled(directions: NDArray[np.float32], factor: float, meter: Meter) -> NDArray[np.float32]:
    """Unit vectors (n, 3) in camera axes with the tangents of their field angles multiplied by a
    factor, as by another focal length."""
    if factor == 1.0:
        return directions
    count = len(directions)
    meter.charge(f32_mul=8 * count, f32_add=2 * count, f32_sqrt=count, f32_div=count, loop=count)
    longer = directions * np.array((factor, factor, 1), np.float32)
    x, y, z = (longer * longer).T
    longer /= np.sqrt(x + y + z)[:, None]
    return longer
