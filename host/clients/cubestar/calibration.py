"""Fits CubeStar's undistortion to a camera that is described the other way round.

Calibration tools give the model of Brown as undistorted to pixel; CubeStar's firmware evaluates it
as pixel to undistorted (CubeStar thesis, equations 4.1.3 to 4.1.5), and then divides by its focal
length (equation 4.1.6). The exact inverse of one is not of the other's form, but close to it. The
firmware's model is linear in its coefficients, so that linear least squares over the frame give
the best ones.
"""

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, PIXEL_PITCH_MM, ROWS
from cubestack.host.errors import CameraFileError

GRID_STEP_PX = 8
INVERSION_STEPS = 100
INVERSION_TOLERANCE_PX = 1e-6


@dataclass(frozen=True)
class Camera:
    """A pinhole with the distortion of Brown, undistorted to pixel.

    With x = X/Z, y = Y/Z and r2 = x^2 + y^2, the column is
    ``cx + f (x (1 + k1 r2 + k2 r2^2) + 2 p1 x y + p2 (r2 + 2 x^2))``, the row likewise with
    ``p1 (r2 + 2 y^2) + 2 p2 x y``.

    Attributes:
        f_px: focal length.
        cx_px, cy_px: principal point.
        k1, k2: radial coefficients.
        p1, p2: tangential coefficients.
    """

    f_px: float
    cx_px: float
    cy_px: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0

    def cropped(self, left_px: float, top_px: float) -> "Camera":
        """The same camera for a part of its picture that begins at (left, top)."""
        return replace(self, cx_px=self.cx_px - left_px, cy_px=self.cy_px - top_px)

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels (..., 2) of points X/Z, Y/Z (..., 2)."""
        x, y = points[..., 0], points[..., 1]
        r2 = x * x + y * y
        radial = 1 + self.k1 * r2 + self.k2 * r2 * r2
        x_d = x * radial + 2 * self.p1 * x * y + self.p2 * (r2 + 2 * x * x)
        y_d = y * radial + 2 * self.p2 * x * y + self.p1 * (r2 + 2 * y * y)
        return np.stack([self.cx_px + self.f_px * x_d, self.cy_px + self.f_px * y_d], axis=-1)

    def unproject(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points X/Z, Y/Z (..., 2) of pixels (..., 2), by fixed-point iteration.

        Raises ValueError when the distortion is too strong to be inverted there.
        """
        start = (pixels - [self.cx_px, self.cy_px]) / self.f_px
        points = start
        with np.errstate(over="ignore", invalid="ignore"):  # a diverging model is told below
            for _ in range(INVERSION_STEPS):
                points = points - (self.project(points) - pixels) / self.f_px
            error_px = np.abs(self.project(points) - pixels).max()
        if not error_px < INVERSION_TOLERANCE_PX:
            raise ValueError(
                f"this distortion can not be inverted over the frame: k1 {self.k1:g}, "
                f"k2 {self.k2:g}, p1 {self.p1:g}, p2 {self.p2:g} with f {self.f_px:g} px"
            )
        return points


@dataclass(frozen=True)
class Calibration:
    """Telecommands that load a camera, and how well the firmware's model describes it.

    Attributes:
        settings: telecommand to parameters, for ``CubeStar.configure``.
        rms_px: root mean square distance over the frame, at the focal length.
        max_px: largest distance.
    """

    settings: dict[str, dict[str, float]]
    rms_px: float
    max_px: float


def calibrate(camera: Camera) -> Calibration:
    """Fit the firmware's parameters to ``camera`` over a frame of 1024 x 512 px.

    Raises ValueError when the camera's distortion can not be inverted over the frame.
    """
    columns, rows = np.meshgrid(
        np.linspace(0, COLUMNS - 1, COLUMNS // GRID_STEP_PX),
        np.linspace(0, ROWS - 1, ROWS // GRID_STEP_PX),
    )
    pixels = np.stack([columns.ravel(), rows.ravel()], axis=-1)
    true = camera.unproject(pixels)

    x, y = ((pixels - [camera.cx_px, camera.cy_px]) / camera.f_px).T
    r2 = x * x + y * y
    along_x = np.stack([x, x * r2, x * r2 * r2, 2 * x * y, r2 + 2 * x * x], axis=-1)
    along_y = np.stack([y, y * r2, y * r2 * r2, r2 + 2 * y * y, 2 * x * y], axis=-1)
    design = np.concatenate([along_x, along_y])
    # The first coefficient scales all: the focal length of the unit vectors takes it over.
    coefficients = np.linalg.lstsq(design, np.concatenate([true[:, 0], true[:, 1]]), rcond=None)[0]
    scale = float(coefficients[0])
    k1, k2, p1, p2 = (float(value) / scale for value in coefficients[1:])

    fitted = (design @ coefficients).reshape(2, -1).T
    distance_px = camera.f_px * np.hypot(*(fitted - true).T)
    return Calibration(
        settings={
            "setFocalLength": {"FocalLength": camera.f_px * PIXEL_PITCH_MM / scale},
            "setFocalLengthComponents": {"Fx": camera.f_px, "Fy": camera.f_px},
            "setPrincipalPoint": {"Cx": camera.cx_px, "Cy": camera.cy_px},
            "setRadialDistortionGains": {"K1": k1, "K2": k2},
            "setTangentalDistortionGains": {"P1": p1, "P2": p2},
        },
        rms_px=float(np.sqrt(np.mean(distance_px**2))),
        max_px=float(distance_px.max()),
    )


def load_camera(path: Path) -> Camera:
    """Camera of a JSON file: its "camera" object, or the file's own keys.

    Keys: f_px, cx_px, cy_px; k1, k2, p1, p2 default to 0; others are ignored. Raises
    CameraFileError (a ValueError).
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CameraFileError(f"{path}: {error.strerror}; give a JSON camera file") from error
    except ValueError as error:
        raise CameraFileError(f"{path}: not JSON: {error}") from error
    keys = content.get("camera", content) if isinstance(content, dict) else content
    if not isinstance(keys, dict):
        raise CameraFileError(f"{path}: must hold an object with f_px, cx_px, cy_px")
    values = {}
    for name in ("f_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2"):
        if name not in keys and name.endswith("_px"):
            raise CameraFileError(f"{path}: camera has no {name}; needed: f_px, cx_px, cy_px")
        value = keys.get(name, 0.0)
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
        ):
            raise CameraFileError(f"{path}: camera's {name} must be a number, not {value!r}")
        values[name] = float(value)
    if values["f_px"] <= 0:
        raise CameraFileError(f"{path}: camera's f_px must be above 0, not {values['f_px']:g}")
    return Camera(**values)
