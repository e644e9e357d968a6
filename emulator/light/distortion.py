"""Brown's model of a lens' distortion, and its inverse by Newton's method.

CubeStar thesis, section 4.1.4, equations 4.1.3 and 4.1.4. `reference` is NumPy; `distortion.cpp`
does the same operations in the same order, so both are equal to the bit.
"""

import ctypes
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.light.library import Library, address, light_library

Numbers = NDArray[np.float64]

STEPS = 20
FOUND = 1e-14
"""Last step of a search, in normalised coordinates."""

FEW = 50
"""Fewer points, as a check of a lens has, are left to NumPy, so that the library is not loaded."""


@dataclass(frozen=True)
class Brown:
    """Radial coefficients k1, k2 and tangential ones p1, p2 of normalised coordinates."""

    k1: float
    k2: float
    p1: float
    p2: float

    def __neg__(self) -> "Brown":
        return Brown(-self.k1, -self.k2, -self.p1, -self.p2)

    def of(self, points: Numbers) -> Numbers:
        """Where the equations map ``points`` (n, 2)."""
        x, y = points.T
        across, down, _, _ = self._terms(x, y)
        return np.stack([across, down], axis=1)

    def inverse(self, targets: Numbers) -> Numbers:
        """Points (n, 2) that ``of`` maps to ``targets`` (n, 2); NaN where none is found."""
        library = None if len(targets) < FEW else light_library()
        return self.reference(targets) if library is None else self.compiled(library, targets)

    @np.errstate(all="ignore")  # a search that does not converge may leave the range of numbers
    def reference(self, targets: Numbers) -> Numbers:
        """The same by NumPy. All points are searched until the last one is found."""
        wanted_x, wanted_y = np.ascontiguousarray(targets.T)
        x, y = wanted_x.copy(), wanted_y.copy()
        for _ in range(STEPS):
            across, down, r2, radial = self._terms(x, y)
            slope = 2 * (self.k1 + 2 * self.k2 * r2)  # of radial, by r2, doubled
            jxx = radial + slope * x * x + 6 * self.p2 * x + 2 * self.p1 * y
            jyy = radial + slope * y * y + 6 * self.p1 * y + 2 * self.p2 * x
            jxy = slope * x * y + 2 * self.p2 * y + 2 * self.p1 * x
            ex, ey = across - wanted_x, down - wanted_y
            determinant = jxx * jyy - jxy * jxy
            step_x = (jyy * ex - jxy * ey) / determinant
            step_y = (jxx * ey - jxy * ex) / determinant
            x -= step_x
            y -= step_y
            found = np.maximum(np.abs(step_x), np.abs(step_y)) < FOUND
            if found.all():
                break
        points = np.stack([x, y], axis=1)
        points[~found] = np.nan
        return points

    def compiled(self, library: Library, targets: Numbers) -> Numbers:
        """The same by the compiled library."""
        targets = np.ascontiguousarray(targets)
        points = np.empty_like(targets)
        coefficients = (ctypes.c_double * 4)(self.k1, self.k2, self.p1, self.p2)
        library.light_undistorted(
            coefficients, address(targets), len(targets), STEPS, FOUND, address(points)
        )
        return points

    def _terms(self, x: Numbers, y: Numbers) -> tuple[Numbers, Numbers, Numbers, Numbers]:
        """Images of coordinates (n,), with the squared radius and the radial factor."""
        r2 = x * x + y * y
        radial = 1 + r2 * (self.k1 + self.k2 * r2)
        across = x * radial + self.p2 * (r2 + 2 * x * x) + 2 * self.p1 * x * y
        down = y * radial + self.p1 * (r2 + 2 * y * y) + 2 * self.p2 * x * y
        return across, down, r2, radial
