"""The part of the sky that an image shows: its border with the lens distortion removed.

A rectangle of pixels is a pincushion or a barrel of directions. Each side is modelled as a parabola
through its two corners and its middle, in tangents of field angles. For the lens of the CubeStar
thesis it is within 2 px of the true border.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import CameraParameters, undistort, unit_vectors
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter

Floats = NDArray[np.float32]

#: Parts of a side whose areas are added up to the solid angle.
_CELLS = 40


@dataclass(frozen=True, eq=False)
class FieldOfView:
    """The field of a camera."""

    #: (3, 2, 2, 1) coefficients of 1, t, t^2 of the sides' tangents: left and upper, then right and
    #: lower one; x as a function of y, y of x
    sides: Floats
    #: cosine of the angle between the boresight and the farthest corner
    smallest_cosine: np.float32
    solid_angle_sr: float  #: of all of the picture in which stars can be seen
    #: cells (down, across) of the picture in which none can; None: there are no such
    blind: NDArray[np.bool_] | None = None

    def without(self, blind: NDArray[np.bool_]) -> Self:
        """The field without cells (down, across), of equal size, in which no star can be seen."""
        if not blind.any():
            return self
        share = 1 - float(blind.mean())
        return replace(self, blind=blind, solid_angle_sr=share * self.solid_angle_sr)

    def contains(self, directions: Floats, meter: Meter, factor: float = 1.0) -> NDArray[np.bool_]:
        """Which unit vectors (n, 3) in camera axes, z above 0, are where stars can be seen;
        ``factor``: by which tangents of measured field angles are multiplied."""
        count = len(directions)
        meter.charge(
            f32_div=2 * count,
            f32_mul=8 * count,
            f32_add=8 * count,
            f32_compare=4 * count,
            loop=count,
        )
        xy = directions.T[:2] / (directions[:, 2] * np.float32(factor))
        yx = xy[::-1]
        constant, linear, square = self.sides
        lower, upper = constant + yx * (linear + yx * square)
        across, down = (xy >= lower) & (xy <= upper)
        inside: NDArray[np.bool_] = across & down
        if self.blind is not None:
            size = np.array(self.blind.shape[::-1])[:, None]
            column, row = np.clip((xy - lower) / (upper - lower) * size, 0, size - 1).astype(int)
            inside &= ~self.blind[row, column]
            meter.charge(f32_div=2 * count, f32_add=4 * count, f32_mul=2 * count)
            meter.charge(f32_convert=2 * count, ram_read=count)
        return inside


@lru_cache(maxsize=8)
def field_of_view(camera: CameraParameters, columns: int, rows: int) -> FieldOfView:
    """The field of a camera with ``columns`` by ``rows`` pixels."""
    x, y = (
        np.array([-0.5, columns / 2 - 0.5, columns - 0.5]),
        np.array([-0.5, rows / 2 - 0.5, rows - 0.5]),
    )
    tangents = _tangents(camera, x, y)
    sides = [
        [
            np.polyfit(tangents[:, k, 1], tangents[:, k, 0], 2),
            np.polyfit(tangents[k, :, 0], tangents[k, :, 1], 2),
        ]
        for k in (0, 2)
    ]
    coefficients = np.moveaxis(np.array(sides, np.float32), 2, 0)[::-1, ..., None]
    largest = float((tangents**2).sum(axis=2).max())
    fine = _tangents(
        camera,
        np.linspace(-0.5, columns - 0.5, _CELLS + 1),
        np.linspace(-0.5, rows - 0.5, _CELLS + 1),
    )
    right, down = fine[:-1, 1:] - fine[:-1, :-1], fine[1:, :-1] - fine[:-1, :-1]
    area = np.abs(right[..., 0] * down[..., 1] - right[..., 1] * down[..., 0])
    middle = (fine[1:, 1:] + fine[:-1, :-1]) / 2
    solid_angle = float((area / (1 + (middle**2).sum(axis=2)) ** 1.5).sum())
    return FieldOfView(coefficients, np.float32((1 + largest) ** -0.5), solid_angle)


def _tangents(
    camera: CameraParameters, x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Tangents (rows, columns, 2) of the field angles of the pixels at all x and y."""
    meter = Meter(CORTEX_M3)
    points = np.stack(np.meshgrid(x, y), axis=2).astype(np.float32)
    rays = unit_vectors(undistort(points.reshape(-1, 2), camera, meter), camera, meter)
    tangents: NDArray[np.float64] = (rays[:, :2] / rays[:, 2:]).astype(np.float64)
    return tangents.reshape(len(y), len(x), 2)
