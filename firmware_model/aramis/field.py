"""The camera's geometry: what it sees, and where a pixel looks.

AraMiS thesis, sections 2.5.2 (MT9M001), 4.5.2 (equation 4.1: pixels need not be square), 8.2 and
appendix E (only the round field across the shorter side is used; a baffle covers the rest).
Camera axes are x right, y down, z out of the lens; an integer pixel coordinate is a pixel's centre.
"""

from dataclasses import dataclass
from functools import cached_property
from math import atan, cos, hypot, pi, radians, tan

import numpy as np

from cubestack.firmware_model.aramis.arrays import Floats, Mask
from cubestack.firmware_model.attitude.lens_models import UNIT_PX, LensErrors
from cubestack.firmware_model.interface.cameras.mt9m001 import COLUMNS, PIXEL_PITCH_MM, ROWS
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.values import DeclaredValues, flag, number, whole

FOV_DEG = 21 + 32 / 60 + 4.7 / 3600

_ONE = np.float32(1)


@dataclass(frozen=True)
class CameraField(DeclaredValues):
    """A pinhole camera and the part of its picture that is used."""

    fov_deg: float = number(FOV_DEG, "field across the shorter side of the picture", 1, 90)
    columns: int = whole(COLUMNS, "of the picture", 16, 4096, "px")
    rows: int = whole(ROWS, "of the picture", 16, 4096, "px")
    pitch_x_mm: float = number(PIXEL_PITCH_MM, "distance of pixel centres in a row", 1e-4, 1)
    pitch_y_mm: float = number(PIXEL_PITCH_MM, "distance of pixel centres in a column", 1e-4, 1)
    round: bool = flag(True, "only the circle across the shorter side is used")
    focal_tolerance: float = number(0.6, "standard deviation of the focal length", 0, 20, "percent")
    shape_tolerance: float = number(
        0.1, "of the ratio of fx to fy, and of the skew", 0, 20, "percent"
    )
    point_tolerance: float = number(3.0, "of the principal point in each axis", 0, 200, "px")
    distortion_tolerance: float = number(
        5.0, "of the distortion, of which nothing is described, at 512 px", 0, 200, "px"
    )

    @property
    def radius_mm(self) -> float:
        return min(self.columns * self.pitch_x_mm, self.rows * self.pitch_y_mm) / 2

    @property
    def focal_length_mm(self) -> float:
        return self.radius_mm / tan(radians(self.fov_deg / 2))

    @property
    def centre(self) -> tuple[float, float]:
        """Column and row of the boresight, px."""
        return (self.columns - 1) / 2, (self.rows - 1) / 2

    @property
    def tolerance(self) -> LensErrors:
        """What a calibration leaves open. A lens' parts are centred to a fifth of a pixel for each
        pixel of radial distortion (assumed)."""
        percent = UNIT_PX / 100
        return LensErrors(
            self.focal_tolerance * percent,
            self.shape_tolerance * percent,
            self.point_tolerance,
            self.distortion_tolerance,
            self.distortion_tolerance / 5,
        )

    @property
    def scale(self) -> tuple[float, float]:
        """Tangent of the angle that a pixel next to the boresight takes, in x and y."""
        return self.pitch_x_mm / self.focal_length_mm, self.pitch_y_mm / self.focal_length_mm

    @cached_property
    def smallest_cosine(self) -> np.float32:
        """Cosine of the angle between the boresight and the farthest direction in the field."""
        width, height = self.columns * self.pitch_x_mm, self.rows * self.pitch_y_mm
        farthest = self.radius_mm if self.round else hypot(width, height) / 2
        return np.float32(cos(atan(farthest / self.focal_length_mm)))

    @cached_property
    def solid_angle_sr(self) -> float:
        """Solid angle of the field, of a rectangle as if it were flat."""
        if self.round:
            return 2 * pi * (1 - float(self.smallest_cosine))
        across, down = self.scale
        return self.columns * across * self.rows * down

    @cached_property
    def mask(self) -> Mask:
        """Which pixels (rows, columns) are in the field; read-only."""
        mask = np.ones((self.rows, self.columns), dtype=bool)
        if self.round:
            y, x = np.ogrid[: self.rows, : self.columns]
            across = (x - self.centre[0]) * self.pitch_x_mm
            mask = np.hypot(across, (y - self.centre[1]) * self.pitch_y_mm) <= self.radius_mm
        mask.flags.writeable = False
        return mask

    @cached_property
    def pixels(self) -> int:
        return int(np.count_nonzero(self.mask))

    def directions(self, points: Floats, meter: Meter) -> Floats:
        """Unit vectors (n, 3) in camera axes of points (n, 2) of the picture in px: eq. 4.1."""
        x, y = self._tangents(points, meter)
        z = _ONE / np.sqrt(_ONE + x * x + y * y)
        count = len(points)
        meter.charge(f32_add=2 * count, f32_mul=4 * count)
        meter.charge(f32_div=count, f32_sqrt=count, loop=count)
        return np.stack([x * z, y * z, z], axis=1).astype(np.float32)

    def inside(self, points: Floats, meter: Meter) -> Mask:
        """Which points (n, 2) of the picture in px are in the field."""
        return self._inside(*self._tangents(points, meter), meter)

    def contains(self, directions: Floats, meter: Meter, factor: float = 1.0) -> Mask:
        """Which unit vectors (n, 3) in camera axes are in the field; ``factor``: by which tangents
        of measured field angles are multiplied."""
        x, y, z = directions.T
        depth = np.maximum(z, np.float32(1e-6)) * np.float32(factor)
        meter.charge(f32_div=2 * len(directions), f32_compare=len(directions))
        in_front: Mask = np.greater(z, 0)
        return in_front & self._inside(x / depth, y / depth, meter)

    def _tangents(self, points: Floats, meter: Meter) -> tuple[Floats, Floats]:
        middle = np.array(self.centre, dtype=np.float32)
        tangents = (points.astype(np.float32) - middle) * np.array(self.scale, dtype=np.float32)
        meter.charge(f32_add=2 * len(points), f32_mul=2 * len(points), ram_read=2 * len(points))
        return tangents[:, 0], tangents[:, 1]

    def _inside(self, x: Floats, y: Floats, meter: Meter) -> Mask:
        count = len(x)
        meter.charge(f32_add=count, f32_mul=2 * count, f32_compare=2 * count, loop=count)
        if self.round:
            return x * x + y * y <= np.float32((self.radius_mm / self.focal_length_mm) ** 2)
        across, down = self.scale
        half_x, half_y = np.float32(self.columns / 2 * across), np.float32(self.rows / 2 * down)
        return (np.abs(x) <= half_x) & (np.abs(y) <= half_y)
