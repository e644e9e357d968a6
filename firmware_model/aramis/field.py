"""The camera's geometry: what it sees, and where a pixel looks.

AraMiS thesis, sections 2.5.2 (MT9M001: 1280 x 1024) and 4.5.2 (equation 4.1), chapter 8 and
appendix E (only the round field across the shorter side is used; the baffle covers the rest).
The pixel pitch of 5.2 um is the sensor's. Camera axes are x right, y down, z out of the lens; an
integer pixel coordinate is a pixel's centre.
"""

from dataclasses import dataclass
from functools import cached_property
from math import atan, cos, hypot, pi, radians, tan

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.algorithms.geometry import CameraParameters
from cubestack.firmware_model.costs import Meter

__all__ = ["COLUMNS", "FOV_DEG", "PIXEL_PITCH_MM", "ROWS", "Field"]

COLUMNS, ROWS = 1280, 1024
PIXEL_PITCH_MM = 0.0052
FOV_DEG = 21.5346


@dataclass(frozen=True)
class Field:
    """A pinhole camera and the part of its picture that is used.

    Attributes:
        fov_deg: field across the shorter side of the picture, 1 to 90 degrees.
        columns, rows: of the picture, 16 to 4096.
        pitch_mm: distance of pixel centres.
        round: whether only the circle across the shorter side is used.
    """

    fov_deg: float = FOV_DEG
    columns: int = COLUMNS
    rows: int = ROWS
    pitch_mm: float = PIXEL_PITCH_MM
    round: bool = True

    def __post_init__(self) -> None:
        """Refuse a camera that sees nothing."""
        if not 1 <= self.fov_deg <= 90:
            raise ValueError(f"fov_deg must be 1 to 90, not {self.fov_deg}")
        for name in ("columns", "rows"):
            if not 16 <= getattr(self, name) <= 4096:
                raise ValueError(f"{name} must be 16 to 4096, not {getattr(self, name)}")
        if not self.pitch_mm > 0:
            raise ValueError(f"pitch_mm must be above 0, not {self.pitch_mm}")

    @property
    def radius_px(self) -> float:
        """Half of the shorter side."""
        return min(self.columns, self.rows) / 2

    @property
    def focal_length_px(self) -> float:
        """Focal length in px."""
        return self.radius_px / tan(radians(self.fov_deg / 2))

    @cached_property
    def camera(self) -> CameraParameters:
        """The same as `geometry.unit_vectors` wants it: equation 4.1 is that of CubeStar."""
        focal = self.focal_length_px
        return CameraParameters(
            focal_length_mm=focal * self.pitch_mm,
            fx=focal,
            fy=focal,
            cx=(self.columns - 1) / 2,
            cy=(self.rows - 1) / 2,
            k1=0,
            k2=0,
            p1=0,
            p2=0,
            pitch_mm=self.pitch_mm,
        )

    @cached_property
    def smallest_cosine(self) -> float:
        """Cosine of the angle between the boresight and the farthest direction in the field."""
        farthest = self.radius_px if self.round else hypot(self.columns, self.rows) / 2
        return cos(atan(farthest / self.focal_length_px))

    @cached_property
    def solid_angle_sr(self) -> float:
        """Solid angle of the field, of a rectangle as if it were flat."""
        if self.round:
            return 2 * pi * (1 - self.smallest_cosine)
        return self.columns * self.rows / self.focal_length_px**2

    @cached_property
    def mask(self) -> NDArray[np.bool_]:
        """Which pixels (rows, columns) are in the field; read-only."""
        mask = np.ones((self.rows, self.columns), dtype=bool)
        if self.round:
            y, x = np.ogrid[: self.rows, : self.columns]
            mask = np.hypot(x - self.camera.cx, y - self.camera.cy) <= self.radius_px
        mask.flags.writeable = False
        return mask

    @cached_property
    def pixels(self) -> int:
        """Number of pixels in the field."""
        return int(np.count_nonzero(self.mask))

    def inside(self, points: NDArray[np.float32], meter: Meter) -> NDArray[np.bool_]:
        """Which points (n, 2) of the picture in px are in the field."""
        x = points[:, 0] - np.float32(self.camera.cx)
        y = points[:, 1] - np.float32(self.camera.cy)
        count = len(points)
        meter.charge(f32_add=3 * count, f32_mul=2 * count, f32_compare=2 * count, loop=count)
        if self.round:
            within: NDArray[np.bool_] = x * x + y * y <= np.float32(self.radius_px**2)
            return within
        return (abs(x) <= np.float32(self.columns / 2)) & (abs(y) <= np.float32(self.rows / 2))

    def contains(self, directions: NDArray[np.float32], meter: Meter) -> NDArray[np.bool_]:
        """Which unit vectors (n, 3) in camera axes are in the field."""
        count = len(directions)
        depth = np.maximum(directions[:, 2:], np.float32(1e-6))
        focal = np.float32(self.focal_length_px)
        centre = np.array([self.camera.cx, self.camera.cy], dtype=np.float32)
        points = directions[:, :2] / depth * focal + centre
        meter.charge(f32_div=count, f32_mul=3 * count, f32_add=2 * count, f32_compare=count)
        in_front: NDArray[np.bool_] = directions[:, 2] > 0
        return in_front & self.inside(points.astype(np.float32), meter)
