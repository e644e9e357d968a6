"""A pinhole camera with the distortion of Brown, and its JSON file."""

import json
import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.formats.untrusted import read_json
from cubestack.host.errors import CameraFileError
from cubestack.host.output import write_output

INVERSION_STEPS = 100
INVERSION_TOLERANCE_PX = 1e-6


@dataclass(frozen=True)
class Camera:
    """A pinhole with the distortion of Brown, undistorted to pixel.

    With x = X/Z, y = Y/Z and r2 = x^2 + y^2, the column is
    ``cx + f (x (1 + k1 r2 + k2 r2^2) + 2 p1 x y + p2 (r2 + 2 x^2))``, the row likewise with
    ``p1 (r2 + 2 y^2) + 2 p2 x y``.
    """

    f_px: float  #: focal length
    #: cx_px, cy_px: principal point
    cx_px: float
    cy_px: float
    #: k1, k2: radial coefficients
    k1: float = 0.0
    k2: float = 0.0
    #: p1, p2: tangential coefficients
    p1: float = 0.0
    p2: float = 0.0

    def cropped(self, left_px: float, top_px: float) -> "Camera":
        """The same camera for a crop of its image that begins at (left, top)."""
        return replace(self, cx_px=self.cx_px - left_px, cy_px=self.cy_px - top_px)

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels (..., 2) of points X/Z, Y/Z (..., 2)."""
        x, y = points[..., 0], points[..., 1]
        r2 = x * x + y * y
        radial = 1 + self.k1 * r2 + self.k2 * r2 * r2
        x_d = x * radial + 2 * self.p1 * x * y + self.p2 * (r2 + 2 * x * x)
        y_d = y * radial + 2 * self.p2 * x * y + self.p1 * (r2 + 2 * y * y)
        return np.stack([self.cx_px + self.f_px * x_d, self.cy_px + self.f_px * y_d], axis=-1)

    def directions(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels (n, 2) of directions (n, 3) in camera axes with z > 0."""
        return self.project(vectors[:, :2] / vectors[:, 2:])

    def unproject(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points X/Z, Y/Z (..., 2) of pixels (..., 2), by fixed-point iteration.

        Raises ValueError if the distortion cannot be inverted there.
        """
        start = (pixels - [self.cx_px, self.cy_px]) / self.f_px
        points = start
        with np.errstate(over="ignore", invalid="ignore"):  # a diverging model is reported below
            for _ in range(INVERSION_STEPS):
                points = points - (self.project(points) - pixels) / self.f_px
            error_px = np.abs(self.project(points) - pixels).max()
        if not error_px < INVERSION_TOLERANCE_PX:
            raise ValueError(
                f"this distortion cannot be inverted over the frame: k1 {self.k1:g}, "
                f"k2 {self.k2:g}, p1 {self.p1:g}, p2 {self.p2:g} with f {self.f_px:g} px"
            )
        return points


def load_camera(path: Path) -> Camera:
    """Camera of a JSON file: its "camera" object, or the file's own keys.

    Keys: f_px, cx_px, cy_px; k1, k2, p1, p2 default to 0; others are ignored. Raises
    CameraFileError (a ValueError).
    """
    try:
        content = read_json(path, CameraFileError, finite=False)  # checked below, by key
    except OSError as error:
        raise CameraFileError(f"{path}: {error.strerror}; give a JSON camera file") from error
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


def save_camera(camera: Camera, path: Path) -> None:
    """Write a file for `load_camera`; raises ValueError if it cannot."""
    write_output(path, json.dumps({"camera": asdict(camera)}, indent=2) + "\n")
