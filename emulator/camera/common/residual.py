"""Errors of a lens that its calibration does not contain: a smooth displacement of the image."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.float64]
Coefficients = tuple[tuple[float, ...], ...]

_INVERSION_STEPS = 50
_INVERSION_PX = 1e-11


class Displacement(Protocol):
    """A displacement of the picture."""

    def at(self, pixels: Pixels) -> Pixels:
        """Displacement (n, 2) at the image points ``pixels`` (n, 2), px."""


@dataclass(frozen=True)
class Residual:
    """Displacement of the picture, a polynomial of the position on the sensor."""

    shape: tuple[int, int]  # rows and columns of the area with coordinates -1..1
    # coefficients in px: for each power of x, those of the powers of y
    across: Coefficients
    down: Coefficients

    def at(self, pixels: Pixels) -> Pixels:
        """Displacement (n, 2) at the image points ``pixels`` (n, 2); outside, as at the edge."""
        rows, columns = self.shape
        x, y = np.clip(2 * pixels / (columns - 1, rows - 1) - 1, -1, 1).T
        return np.stack([_horner(x, y, self.across), _horner(x, y, self.down)], axis=1)


@dataclass(frozen=True)
class Warp:
    """Displacement that is linear, and cubic in the radius, about a point of the picture."""

    middle: tuple[float, float]  # column and row, px
    #: displacement in px per px: of the column by column and row, then of the row
    linear: tuple[tuple[float, float], tuple[float, float]] = ((0, 0), (0, 0))
    cubic: float = 0.0  # displacement away from the point, px per px^3

    def at(self, pixels: Pixels) -> Pixels:
        """Displacement (n, 2) at the image points ``pixels`` (n, 2)."""
        offset = pixels - self.middle
        radius2 = np.sum(offset * offset, axis=1, keepdims=True)
        return np.asarray(offset @ np.array(self.linear).T + self.cubic * radius2 * offset)


@dataclass(frozen=True)
class Swing:
    """Rows that swing to and fro, as of a camera that shakes while its rows are read in turn."""

    px: float  # largest displacement
    direction: float  # of the swing, rad from the row's direction
    rows: float  # of one swing
    phase: float  # at row 0, rad

    def at(self, pixels: Pixels) -> Pixels:
        """Displacement (n, 2) at the image points ``pixels`` (n, 2)."""
        swing = self.px * np.sin(2 * np.pi * pixels[:, 1] / self.rows + self.phase)
        return np.outer(swing, (np.cos(self.direction), np.sin(self.direction)))


def displace(pixels: Pixels, residuals: tuple[Displacement, ...]) -> Pixels:
    """Image points (n, 2) of the ideal points ``pixels``, to 1e-11 px for smooth residuals.

    NaN stays NaN.
    """
    for residual in residuals:
        belongs, pixels = pixels, pixels + residual.at(pixels)
        for _ in range(_INVERSION_STEPS):
            missed = belongs + residual.at(pixels) - pixels
            pixels = pixels + missed
            if not np.any(np.abs(missed) > _INVERSION_PX):
                break
    return pixels


def restore(pixels: Pixels, residuals: tuple[Displacement, ...]) -> Pixels:
    """Inverse of `displace`, and the faster of the two: for all pixels of an image."""
    for residual in reversed(residuals):
        pixels = pixels - residual.at(pixels)
    return pixels


def _horner(x: Pixels, y: Pixels, coefficients: Coefficients) -> Pixels:
    """The polynomial's values (n,); skips zero coefficients at the end of a row."""
    total = np.zeros_like(x)
    for row in reversed(coefficients):
        total *= x
        while row and row[-1] == 0:
            row = row[:-1]
        inner = np.zeros_like(y)
        for coefficient in reversed(row):
            inner *= y
            inner += coefficient
        total += inner
    return total
