"""Which directions lie in the picture: its border, with the lens' distortion undone.

A rectangle of pixels is a pincushion or a barrel of directions. Each of its sides is a parabola
here, through its two corners and its middle, in tangents of field angles; for CubeStar's lens it
stays within 2 px of the true one.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import CameraParameters, undistort, unit_vectors
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Field:
    """The field of a camera.

    Attributes:
        sides: (4, 3) coefficients 1, t, t^2 of the sides' tangents: left and right (x by y), upper
            and lower (y by x).
        smallest_cosine: cosine of the angle between the boresight and the farthest corner.
        solid_angle_sr: of the whole picture.
    """

    sides: Floats
    smallest_cosine: np.float32
    solid_angle_sr: float

    def contains(self, directions: Floats, meter: Meter, factor: float = 1.0) -> NDArray[np.bool_]:
        """Whether unit vectors (n, 3) in camera axes, z above 0, lie in the picture.

        ``factor`` is that by which measured tangents are multiplied to make directions of them.
        """
        count = len(directions)
        meter.charge(f32_div=2 * count, f32_mul=8 * count, f32_add=8 * count, f32_compare=4 * count)
        meter.charge(loop=count)
        depth = directions[:, 2] * np.float32(factor)
        x, y = directions[:, 0] / depth, directions[:, 1] / depth
        left, right = (a + y * (b + y * c) for a, b, c in self.sides[:2])
        upper, lower = (a + x * (b + x * c) for a, b, c in self.sides[2:])
        inside: NDArray[np.bool_] = (x >= left) & (x <= right) & (y >= upper) & (y <= lower)
        return inside


@lru_cache(maxsize=8)
def field_of(camera: CameraParameters, columns: int, rows: int) -> Field:
    """The field of a camera with so many pixels; made when a camera's parameters change."""
    meter = Meter(CORTEX_M3)
    x = np.array([-0.5, columns / 2 - 0.5, columns - 0.5], np.float32)
    y = np.array([-0.5, rows / 2 - 0.5, rows - 0.5], np.float32)
    points = np.array([[a, b] for b in y for a in x], np.float32)
    rays = unit_vectors(undistort(points, camera, meter), camera, meter).astype(np.float64)
    tangents = (rays[:, :2] / rays[:, 2:]).reshape(3, 3, 2)
    sides = [np.polyfit(tangents[:, side, 1], tangents[:, side, 0], 2)[::-1] for side in (0, 2)] + [
        np.polyfit(tangents[side, :, 0], tangents[side, :, 1], 2)[::-1] for side in (0, 2)
    ]
    fine = np.linspace(-1, 1, 41) * 0.999
    grid = np.stack(np.meshgrid(fine * columns / 2 + columns / 2, fine * rows / 2 + rows / 2), 2)
    grid_rays = unit_vectors(
        undistort(grid.reshape(-1, 2).astype(np.float32), camera, meter), camera, meter
    ).astype(np.float64)
    plane = (grid_rays[:, :2] / grid_rays[:, 2:]).reshape(41, 41, 2)
    right, down = plane[:-1, 1:] - plane[:-1, :-1], plane[1:, :-1] - plane[:-1, :-1]
    area = np.abs(right[..., 0] * down[..., 1] - right[..., 1] * down[..., 0])
    cosine3 = grid_rays[:, 2].reshape(41, 41)[:-1, :-1] ** 3
    return Field(
        np.array(sides, np.float32), np.float32(rays[:, 2].min()), float((area * cosine3).sum())
    )
