"""Pictures of a made-up sky, drawn in double precision with the published calibration."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude.field_of_view import FieldOfView, field_of_view
from cubestack.firmware_model.attitude.geometry import CameraParameters
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter

COLUMNS, ROWS = 1024, 512
FX, FY, CX, CY = 1147.5, 1147.4, 539.0, 175.5
K1, K2, P1, P2 = 0.32358, -0.12456, -0.00414, 0.00624
FOCAL_PX = 6.28 / 0.0056
SIGMA_PX = 1.1
PEAK_DN = 150.0


def meter() -> Meter:
    return Meter(CORTEX_M3)


def pinhole() -> FieldOfView:
    """The field that ``shoot`` draws: no distortion, the principal point in the middle."""
    middle = CameraParameters(6.28, FOCAL_PX, FOCAL_PX, 511.5, 255.5, 0, 0, 0, 0)
    return field_of_view(middle, COLUMNS, ROWS)


@dataclass
class Sky:
    """A picture, how it was taken, and what is on it: catalogue index and place of each star."""

    picture: NDArray[np.uint8]
    attitude: Rotation
    stars: NDArray[np.int64]
    pixels: NDArray[np.float64]


def undistort(pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y = (pixels[:, 0] - CX) / FX, (pixels[:, 1] - CY) / FY
    r2 = x**2 + y**2
    radial = 1 + K1 * r2 + K2 * r2**2
    return np.stack(
        [
            CX + FX * (x * radial + P2 * (r2 + 2 * x**2) + 2 * P1 * x * y),
            CY + FY * (y * radial + P1 * (r2 + 2 * y**2) + 2 * P2 * x * y),
        ],
        axis=1,
    )


def distort(wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of ``undistort``, by fixed-point iteration."""
    pixels = wanted.copy()
    for _ in range(100):
        pixels += wanted - undistort(pixels)
    assert np.allclose(undistort(pixels), wanted, atol=1e-6)
    return pixels


def take(catalogue: StarCatalogue, attitude: Rotation, most: int | None = None) -> Sky:
    """The view of a camera with this attitude (inertial to camera); at most ``most`` stars."""
    return draw(catalogue.vectors, attitude, most)


def draw(vectors: NDArray[Any], attitude: Rotation, most: int | None = None) -> Sky:
    """A sky with stars at the ``vectors`` (n, 3)."""
    body = attitude.apply(vectors.astype(float))
    near = np.flatnonzero(body[:, 2] > 0.8)
    ideal = np.array([CX, CY]) + FOCAL_PX * body[near, :2] / body[near, 2:]
    pixels = distort(ideal)
    inside = np.all((pixels > 6) & (pixels < np.array([COLUMNS, ROWS]) - 7), axis=1)
    stars, pixels = near[inside][:most], pixels[inside][:most]
    light = np.zeros((ROWS, COLUMNS))
    y, x = np.mgrid[:ROWS, :COLUMNS]
    for x0, y0 in pixels:
        box = (slice(int(y0) - 6, int(y0) + 8), slice(int(x0) - 6, int(x0) + 8))
        distance2 = (x[box] - x0) ** 2 + (y[box] - y0) ** 2
        light[box] += PEAK_DN * np.exp(-distance2 / (2 * SIGMA_PX**2))
    return Sky(np.minimum(light, 255).astype(np.uint8), attitude, stars, pixels)


def attitude_of(values: dict[str, Any]) -> Rotation:
    """The rotation inertial to camera in telemetry AttitudeQuaternion."""
    return Rotation.from_quat([values[f"Q{index}"] for index in range(4)])


def error_deg(measured: Rotation, true: Rotation) -> float:
    return float(np.degrees((measured * true.inv()).magnitude()))
