"""What no calibration knows of a lens: a smooth displacement of its picture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.float64]
Coefficients = tuple[tuple[float, ...], ...]

_INVERSION_STEPS = 50
_INVERSION_PX = 1e-11


@dataclass(frozen=True)
class Residual:
    """Polynomials across the sensor.

    Attributes:
        shape: rows and columns that the coordinates -1..1 span.
        across, down: coefficients of Legendre's polynomials, px, by powers of x, then of y.
    """

    shape: tuple[int, int]
    across: Coefficients
    down: Coefficients

    def at(self, pixels: Pixels) -> Pixels:
        """Displacement (n, 2) at pixel coordinates (n, 2), px; beyond the sensor as at its edge."""
        rows, columns = self.shape
        x, y = np.clip(2 * pixels / (columns - 1, rows - 1) - 1, -1, 1).T
        both = [np.polynomial.legendre.legval2d(x, y, c) for c in (self.across, self.down)]
        return np.stack(both, axis=1)


def displaced(pixels: Pixels, residuals: tuple[Residual, ...]) -> Pixels:
    """Where points are imaged that belong at ``pixels`` (n, 2)."""
    for residual in residuals:
        pixels = pixels + residual.at(pixels)
    return pixels


def restored(pixels: Pixels, residuals: tuple[Residual, ...]) -> Pixels:
    """Inverse of `displaced`, to 1e-11 px for displacements that change slowly."""
    for residual in reversed(residuals):
        seen = pixels
        for _ in range(_INVERSION_STEPS):
            missed = seen - (pixels + residual.at(pixels))
            pixels = pixels + missed
            if not np.abs(missed).max(initial=0) > _INVERSION_PX:
                break
    return pixels
