"""Prediction of the stars in an image by an attitude, and the false-alarm probability.

The attitude is refined with the predicted stars that were measured, within three margins first,
then within one. Agreement within a small part of the margin is stronger evidence, so such parts are
tried as well, and count as tries.
"""

from bisect import bisect
from dataclasses import dataclass, replace
from functools import lru_cache
from math import exp, factorial, inf, pi
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import scaled, turned
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.confirmation import (
    by_chance,
    correction,
    false_alarm,
    matched,
)

Floats = NDArray[np.float32]
Indices = NDArray[np.intp]

#: False alarms a picture, above which an attitude is refused.
LARGEST_FALSE_ALARM = 1e-4

#: Parts of the margin within which stars and sides may agree.
LEVELS = (0.0625, 0.25, 0.5, 1.0)

#: Stars from which on the focal length is fitted as well.
STARS_FOR_SCALE = 5

#: Change of the focal length from which on it counts as another.
OTHER_SCALE = 1e-3

#: Stars in a picture, of those that the catalogue's density gives, below which a Poisson
#: distribution has more of them than the sky with its empty regions: measured, see the test.
_UNEVEN = 0.7


class CatalogueStars(Protocol):
    """Stars of a catalogue."""

    @property
    def vectors(self) -> Floats:
        """Inertial unit vectors (n, 3)."""

    def within(self, boresight: Floats, least: np.float32, meter: Meter) -> Indices:
        """Stars, rising, whose cosine with a unit vector (3,) is ``least`` or more."""


class View(Protocol):
    """The part of the sky that an image shows."""

    @property
    def smallest_cosine(self) -> np.float32:
        """Cosine of the angle between the boresight and the farthest direction."""

    @property
    def solid_angle_sr(self) -> float: ...

    def contains(self, directions: Floats, meter: Meter, factor: float = 1.0) -> NDArray[np.bool_]:
        """Which unit vectors (n, 3) are where stars can be seen; ``factor``: by which tangents of
        measured field angles are multiplied."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """An attitude with the stars that confirm it."""

    #: (k,) centroid, catalogue star, and angle between them in rad
    centroids: Indices
    stars: Indices
    residuals: Floats
    rotation: Floats  #: (3, 3) inertial to camera
    factor: float  #: by which tangents of measured field angles are multiplied
    expected: int  #: catalogue stars predicted in the picture
    false_alarm: float  #: expected wrong attitudes that are confirmed as well


@dataclass(frozen=True, eq=False)
class Observation:
    """Measured stars, and the sky and camera that they are compared with."""

    directions: Floats  #: (n, 3) unit vectors in camera axes, by the calibration
    stars: CatalogueStars  #: catalogue stars that may be among them
    view: View  #: what the picture shows
    margin_rad: float  #: largest distance of a star from its predicted place
    meter: Meter
    #: shares of the margin within which stars may agree, rising; the last is 1
    levels: tuple[float, ...] = LEVELS
    #: attitudes that count for one whose focal length was changed: it can be any
    scales: float = 1.0

    def mirrored(self) -> Self:
        """The same with left and right exchanged about the boresight."""
        return replace(self, directions=self.directions * np.array([-1, 1, 1], np.float32))

    def confirm(
        self,
        rotation: Floats,
        given: int,
        tries: float,
        *,
        factor: float = 1.0,
        largest: float = LARGEST_FALSE_ALARM,
    ) -> Candidate:
        """Refine an attitude ``rotation`` (3, 3), inertial to camera, and compute its false alarms.

        Args:
            given: stars that propose the attitude.
            tries: expected wrong attitudes that such stars have proposed so far.
            factor: by which tangents of field angles are multiplied.
            largest: false alarms above which the attitude is not refined.
        """
        meter, margin = self.meter, self.margin_rad
        near, ahead, places = self._predict(rotation, factor)
        rays = scaled(self.directions, factor, meter)
        rows, predicted, apart = matched(rays, places, 3 * margin, meter)
        refined, loose = 0, True
        while loose and len(rows) >= given and refined < 2:
            if self._chance(len(near), len(rows), given, self.levels[0], tries) > largest:
                break
            loose = bool(apart.max() > margin)
            turn, change = correction(
                rays[rows], places[predicted], meter, with_scale=len(rows) >= STARS_FOR_SCALE
            )
            rotation, refined = turn @ rotation, refined + 1
            places = turned(ahead, rotation)
            meter.charge(f32_mul=9 * len(near) + 27, f32_add=6 * len(near) + 18, loop=len(near))
            if change != 1.0:
                factor *= change
                rays = scaled(self.directions, factor, meter)
            rows, predicted, apart = matched(rays, places, margin, meter)
        if abs(factor - 1) > OTHER_SCALE:
            tries *= self.scales
        least, most = inf, given - 1
        distances = sorted(apart.tolist())
        for level in self.levels if refined else ():
            found = bisect(distances, level * margin)
            if found > most:  # the same within a larger reach says less
                least = min(least, self._chance(len(near), found, given, level, tries))
                most = found
        return Candidate(rows, near.take(predicted), apart, rotation, factor, len(near), least)

    def _predict(self, rotation: Floats, factor: float) -> tuple[Indices, Floats, Floats]:
        """Stars (m,) in the image, and their unit vectors (m, 3) in inertial and camera axes."""
        meter, vectors = self.meter, self.stars.vectors
        near = self.stars.within(rotation[2], self.view.smallest_cosine, meter)
        ahead = vectors.take(near, axis=0)
        places = turned(ahead, rotation)
        meter.charge(f32_mul=9 * len(near), f32_add=6 * len(near), loop=len(near))
        inside = self.view.contains(places, meter, factor).nonzero()[0]
        return near.take(inside), ahead.take(inside, axis=0), places.take(inside, axis=0)

    def _chance(self, expected: int, found: int, given: int, level: float, tries: float) -> float:
        """False alarms where ``found`` places agree within a part of the margin."""
        spare = len(self.directions) - given
        chance = by_chance(spare, level * self.margin_rad, self.view.solid_angle_sr)
        further, missing = found - given, expected - found
        with self.meter.phase("selection"):
            # Without further stars all parts of the margin say the same.
            tries *= len(self.levels) if further else 1
            odds = false_alarm(tries, further + missing, further, chance, self.meter)
            if missing > 0:
                return odds
            # A wrong attitude seldom puts so few stars into the picture that none is missing.
            self.meter.charge(flash_read=1, f32_mul=1)
            return odds * so_few(expected, len(self.stars.vectors), self.view.solid_angle_sr)


@lru_cache(maxsize=256)
def so_few(expected: int, stars: int, solid_angle_sr: float) -> float:
    """Largest share of the sky with at most ``expected`` of all its ``stars`` in an image."""
    mean = _UNEVEN * stars / (4 * pi) * solid_angle_sr
    return exp(-mean) * sum(mean**number / factorial(number) for number in range(expected + 1))
