"""A fisheye's axis and polynomial from lights, or an Earth's limb, at known angles.

CubeSense thesis, section 5.2.1: a dot at every 5 deg, and a polynomial of the radius in the picture
by that at 2.9 px a degree (equation 5.2.2). Here the axis is fitted with it, by least squares.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

NOISE_PX, BELIEF_PX, RIM_PX = 0.15, 1.5, 0.05
"""Assumed errors of a measured position, of the first lens every 5 deg, and of its rim, whose
radius is published (table 5.1). They keep the lens as it was where nothing was measured."""

ROUNDS = 8
SCALE_PX = 100.0
LEAST = 8
"""Minimum number of positions for a fit."""


@dataclass(frozen=True)
class Fisheye:
    """A lens in the sensor's parameters."""

    #: x_px, y_px: pixel of the optical axis
    x_px: float
    y_px: float
    factors: tuple[float, ...]  #: r_d = sum of factors[k] r_u^k, both radii in px
    px_per_degree: float  #: r_u of a field angle
    field_deg: float  #: largest field angle; the rim's radius in the picture is known

    def project(self, angles: Points) -> Points:
        """Pixels (n, 2) of lights at angles alpha and beta (n, 2), deg, off the axis."""
        theta = np.hypot(*angles.T)
        radius = np.polynomial.polynomial.polyval(theta * self.px_per_degree, self.factors)
        return np.asarray((self.x_px, self.y_px) + angles * (radius / theta)[:, None])


@dataclass(frozen=True, eq=False)
class FisheyeFit:
    """Result of a fit: the lens, and root mean square residuals before and after."""

    lens: Fisheye
    places: int
    before_px: float
    after_px: float


def fit_fisheye(
    pixels: Points, angles: Callable[[Points], Points], before: Fisheye, *, outline: bool
) -> FisheyeFit:
    """Fit to ``pixels`` (n, 2), whose angles (n, 2) are known.

    ``angles`` returns them. For an ``outline`` they are its crossings of the azimuths (n,) in rad,
    so only distances from the axis count. Raises ValueError for too few positions.
    """
    if len(pixels) < LEAST:
        raise ValueError(f"a calibration needs {LEAST} places at least; {len(pixels)} were found")
    lens = before
    nodes = np.arange(0, before.field_deg + 1, 5) * before.px_per_degree
    believed = np.full(len(nodes), BELIEF_PX)
    believed[-1] = RIM_PX
    powers = np.arange(len(before.factors))
    for _ in range(ROUNDS):
        known = _known(pixels, angles, lens)
        theta = np.hypot(*known.T)
        towards = known / theta[:, None]
        radii = np.vander(theta * lens.px_per_degree / SCALE_PX, len(powers), increasing=True)
        offsets = pixels - (lens.x_px, lens.y_px)
        # Along the azimuth, axis and polynomial matter; across it, only the axis.
        rows = [np.hstack([towards, radii]) / NOISE_PX]
        values = [np.sum(offsets * towards, axis=1) / NOISE_PX]
        if not outline:
            across = towards[:, ::-1] * (-1, 1)
            rows.append(np.hstack([across, 0 * radii]) / NOISE_PX)
            values.append(np.sum(offsets * across, axis=1) / NOISE_PX)
        belief = np.vander(nodes / SCALE_PX, len(powers), increasing=True)
        rows.append(np.hstack([np.zeros((len(nodes), 2)), belief]) / believed[:, None])
        values.append(np.polynomial.polynomial.polyval(nodes, before.factors) / believed)
        found = np.linalg.lstsq(np.vstack(rows), np.concatenate(values), rcond=None)[0]
        factors = tuple((found[2:] / SCALE_PX**powers).tolist())
        x_px, y_px = lens.x_px + float(found[0]), lens.y_px + float(found[1])
        lens = replace(lens, x_px=x_px, y_px=y_px, factors=factors)
    return FisheyeFit(
        lens,
        len(pixels),
        *(_rms(pixels, _known(pixels, angles, one), one, outline) for one in (before, lens)),
    )


def limb_angles(azimuths: Points, centres: Points, radius_deg: float) -> Points:
    """Angles (n, 2) of the far crossings of circles in the sky with azimuths (n,) in rad.

    ``centres`` (n, 2) are their angles alpha and beta; the axis lies within the circles.
    """
    theta = np.radians(np.hypot(*centres.T))
    apart = azimuths - np.arctan2(centres[:, 1], centres[:, 0])
    # cos(radius) = cos(theta) cos(t) + sin(theta) cos(apart) sin(t), solved for t.
    level, slope = np.cos(theta), np.sin(theta) * np.cos(apart)
    found = np.arctan2(slope, level) + np.arccos(
        np.cos(np.radians(radius_deg)) / np.hypot(level, slope)
    )
    towards = np.stack([np.cos(azimuths), np.sin(azimuths)], axis=1)
    return np.asarray(np.degrees(found)[:, None] * towards)


def _known(pixels: Points, angles: Callable[[Points], Points], lens: Fisheye) -> Points:
    return angles(np.arctan2(pixels[:, 1] - lens.y_px, pixels[:, 0] - lens.x_px))


def _rms(pixels: Points, known: Points, lens: Fisheye, outline: bool) -> float:
    missed = pixels - lens.project(known)
    if outline:
        missed = np.sum(missed * known, axis=1, keepdims=True) / np.hypot(*known.T)[:, None]
    return float(np.sqrt(np.sum(missed**2, axis=1).mean()))
