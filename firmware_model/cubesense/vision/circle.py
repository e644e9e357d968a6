"""Circles through edges, in the part's single precision.

CubeSense thesis, sections 4.4.1.3 and 6.5.3.1 (least squares, equations 4.4.13 to 4.4.18, by the
inverse's first rows). Extensions are the radius, which needs the third row too, removing one point
from the sums again, and rejecting points that form no circle.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision.arithmetic import sequential_sum
from cubestack.firmware_model.mcu.costs import Meter

Values = NDArray[np.float32]

FEWEST = 3  #: points that a circle needs


@dataclass(frozen=True)
class Circle:
    """A circle in the unit of its points: centre (x, y) and radius."""

    x: np.float32
    y: np.float32
    radius: np.float32

    @property
    def power(self) -> np.float32:
        """Power of the origin: squared distance of the centre less squared radius."""
        return self.x * self.x + self.y * self.y - self.radius * self.radius

    def residuals(self, points: Values, meter: Meter) -> Values:
        """Distances outside of the circle of points (n, 2), to first order: (d^2 - R^2) / 2R."""
        dx, dy = points[:, 0] - self.x, points[:, 1] - self.y
        square = self.radius * self.radius
        count = len(points)
        meter.charge(f32_add=4 * count, f32_mul=3 * count + 2, f32_div=1, loop=count)
        return np.asarray((dx * dx + dy * dy - square) * (np.float32(0.5) / self.radius))


class LeastSquaresCircle:
    """The normal equations of points (n, 2)."""

    def __init__(self, points: Values, meter: Meter) -> None:
        self._meter = meter
        self._count = len(points)
        self._sums = sequential_sum(self._terms(points))

    def remove(self, point: Values) -> None:
        self._sums = self._sums - self._terms(point[None])[0]
        self._count -= 1

    def _terms(self, points: Values) -> Values:
        """Terms of each point (n, 8); the published program sums all 12 elements."""
        x, y = points.astype(np.float32).T
        z = x * x + y * y
        self._meter.charge(f32_mul=14 * len(points), f32_add=13 * len(points), loop=len(points))
        two = np.float32(2)
        return np.stack([two * x * x, two * x * y, two * y * y, x, y, z * x, z * y, z], axis=1)

    def solve(self) -> Circle | None:
        """The circle; None if there are too few points, or they lie on a line."""
        if self._count < FEWEST:
            return None
        determinant, products = self._solution()
        xx, _, yy, *_ = self._sums
        self._meter.charge(f32_mul=18 + 3 + 9, f32_add=9 + 2 + 6, f32_compare=1)
        # A determinant this small relative to its largest product is only rounding.
        if abs(determinant) <= np.float32(1e-5) * abs(xx * yy * np.float32(self._count)):
            return None
        x, y, c = products / determinant
        square = x * x + y * y + c
        self._meter.charge(f32_div=3, f32_mul=2, f32_add=2, f32_compare=1, f32_sqrt=1)
        if not square > 0:
            return None
        return Circle(x, y, np.sqrt(square))

    def centre(self) -> Values | None:
        """The centre (2,) as in listing C.5, from any points.

        None where it divides by 0, which the listing does not prevent.
        """
        determinant, products = self._solution()
        self._meter.charge(f32_mul=9 + 12 + 6, f32_add=5 + 6 + 4, f32_div=2)
        return products[:2] / determinant if determinant else None

    def _solution(self) -> tuple[np.float32, Values]:
        """Determinant; and it times the centre (x, y) and (squared radius - squared centre)."""
        xx, xy, yy, sx, sy, zx, zy, z = self._sums
        n = np.float32(self._count)
        matrix = np.array([[xx, xy, sx], [xy, yy, sy], [2 * sx, 2 * sy, n]])

        def rotated(down: int, right: int) -> Values:
            return np.roll(matrix, (-down, -right), (0, 1))

        # The inverse, transposed, times the determinant; cyclic indices give the sign.
        cofactors = rotated(1, 1) * rotated(2, 2) - rotated(1, 2) * rotated(2, 1)
        determinant = np.float32(sequential_sum(matrix[0] * cofactors[0]))
        # The thesis' unknowns are the negative centre, and its right side is negative too.
        return determinant, sequential_sum(cofactors * np.array([[zx], [zy], [z]]))
