"""Kinds of lenses: how large the errors of a lens usually are, and how probable each kind is."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Reals = NDArray[np.float64]

UNIT_PX = 512.0  #: distance from the principal point at which errors of the lens are given in px
COUNT = 9  #: errors of a lens

DESCRIBED, TOLERATED, LARGEST = 0, 3, -1  #: places in ``lenses``: with no error, all tolerated, all

FOCAL_PX = 15.0  #: usual size of a significant error of the focal length, as of the others below


@dataclass(frozen=True)
class LensErrors:
    """Usual sizes of a lens' errors in px, ``UNIT_PX`` from the principal point."""

    focal: float = 0.0  #: by the focal length
    shape: float = 0.0  #: by pixels that are wider than high, and by skew
    point: float = 0.0  #: of the principal point, along a row and along a column
    radial: float = 0.0  #: by distortion of third and of fifth order
    tangential: float = 0.0

    @property
    def sizes_px(self) -> Reals:
        """(9,) in the order of ``displacements``."""
        pair = self.shape, self.shape
        point, tangential = (self.point, self.point), (self.tangential, self.tangential)
        return np.array((self.focal, *pair, *point, self.radial, *tangential, self.radial))


@dataclass(frozen=True)
class LensModel:
    """A kind of lens."""

    sizes: LensErrors
    prior: float  #: probability before the picture
    is_other: bool = False  #: not the one described

    @property
    def columns(self) -> NDArray[np.intp]:
        """Errors that it has."""
        return np.flatnonzero(self.sizes.sizes_px)

    @property
    def moves_boresight(self) -> bool:
        return self.sizes.point > 0


def lenses(tolerance: LensErrors, focal_px: float = 0.0) -> tuple[LensModel, ...]:
    """Kinds of lenses, the described one first; all have a focal length that differs by
    ``focal_px`` at least. Probabilities are chosen."""
    tolerance = replace(tolerance, focal=max(tolerance.focal, focal_px))
    point, others = LensErrors(focal_px, point=tolerance.point), replace(tolerance, point=0.0)
    return (
        LensModel(LensErrors(focal_px), 0.3),
        LensModel(point, 0.25),
        LensModel(others, 0.1),
        LensModel(tolerance, 0.2),
        LensModel(replace(others, focal=FOCAL_PX, shape=13.0), 0.05, is_other=True),
        LensModel(replace(point, point=20.0), 0.04, is_other=True),
        LensModel(replace(tolerance, point=20.0), 0.03, is_other=True),
        LensModel(LensErrors(FOCAL_PX, 13.0, 20.0, 6.0, 3.0), 0.03, is_other=True),
    )


def displacements(pixels: Floats, centre: tuple[float, float]) -> Reals:
    """Displacements (9, n, 2) of the stars' places for an error of 1 px each, as ``sizes_px``."""
    x, y = ((pixels - np.array(centre)) / UNIT_PX).T
    one, none, r2 = np.ones_like(x), np.zeros_like(x), x * x + y * y
    fields = [
        (x, y),
        (x, -y),
        (y, none),
        (one, none),
        (none, one),
        (r2 * x, r2 * y),
        (3 * x * x + y * y, 2 * x * y),
        (2 * x * y, x * x + 3 * y * y),
        (r2 * r2 * x, r2 * r2 * y),
    ]
    return np.array(fields, float).transpose(0, 2, 1)
