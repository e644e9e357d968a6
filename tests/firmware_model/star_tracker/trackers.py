"""CubeStar's and AraMiS' searches on random skies, behind one interface."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.matching import identification as triples
from cubestack.firmware_model.aramis.pipeline import VERIFIED
from cubestack.firmware_model.aramis.solution import StarList
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.matching import confirmed as pairs
from cubestack.firmware_model.interface.aramis import Reason
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.star_tracker.search import MatchOutcome
from cubestack.host.studies.aramis import sky as aramis_sky

from ..cubestar import sky as cubestar_sky

Rays = NDArray[np.float32]


@dataclass(frozen=True)
class Sky:
    """Measured directions (n, 3), the brightest first, their stars, -1 for none, and boresight."""

    directions: Rays
    stars: NDArray[np.int64]
    boresight: NDArray[np.float64]


@dataclass(frozen=True)
class Found:
    """Identified stars (n,), -1 for none; the outcome's name; and the rating."""

    stars: NDArray[np.int32]
    outcome: str
    false_alarm: float
    expected: int
    scale: float

    def is_right(self, stars: NDArray[np.int64]) -> bool:
        """Whether it is solved; fails where more than a few identities are wrong."""
        named = self.stars != -1
        wrong = int((self.stars[named] != stars[named]).sum())
        # A false star may be within the margin of a real one's place, and nearer to it.
        assert wrong <= max(1, int(named.sum()) // 5)
        return bool(named.any())


class Tracker(ABC):
    limit_s: float
    fewest: int
    edge: tuple[float, float]
    """Tangents of the field angles within which all places are in the field."""

    @abstractmethod
    def sky(self, rng: np.random.Generator, false_stars: int = 0) -> Sky: ...

    @abstractmethod
    def meter(self) -> Meter: ...

    @abstractmethod
    def identify(self, rays: Rays, meter: Meter | None = None, hint: Any = None) -> Found: ...

    def false_rays(self, rng: np.random.Generator, count: int) -> Rays:
        """Unit vectors (count, 3) of stars that do not exist."""
        places = rng.uniform(np.negative(self.edge), self.edge, (count, 2))
        rays = np.column_stack([places, np.ones(count)])
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True), np.float32)


class PairTracker(Tracker):
    """CubeStar's, from a list of pairs."""

    limit_s, fewest, edge = 0.25, 3, (0.45, 0.22)

    def __init__(self, catalogue: StarCatalogue, shoot: Any) -> None:
        self.catalogue, self.shoot, self.field = catalogue, shoot, cubestar_sky.pinhole()

    def sky(self, rng: np.random.Generator, false_stars: int = 0) -> Sky:
        while True:
            shot = self.shoot(rng, false_stars=false_stars, most=40)
            if np.count_nonzero(shot.stars >= 0) >= 5:
                return Sky(shot.directions, shot.stars, shot.attitude[2])

    def meter(self) -> Meter:
        return cubestar_sky.meter()

    def identify(self, rays: Rays, meter: Meter | None = None, hint: Any = None) -> Found:
        found = pairs.identify(
            rays, None, self.catalogue, self.field, meter or self.meter(), boresight=hint
        )
        alarm, outcome = found.false_alarm, found.outcome.name
        return Found(found.stars, outcome, alarm, found.expected, found.scale)


class TripleTracker(Tracker):
    """AraMiS', from a database of triangles."""

    limit_s, fewest, edge = 0.65, 4, (0.13, 0.13)

    def __init__(self) -> None:
        self.field, self.database = aramis_sky.FIELD, aramis_sky.database()

    def sky(self, rng: np.random.Generator, false_stars: int = 0) -> Sky:
        light = aramis_sky.Light(false_stars=false_stars, false_mags=(0.0, 4.0), most=60)
        made = aramis_sky.picture(rng, self.field, light)
        numbers = {int(number): star for star, number in enumerate(self.database.numbers)}
        stars = np.array([numbers.get(int(hip), -1) for hip in made.hip])
        directions = self.field.directions(made.stars.centroids, self.meter())
        return Sky(directions, stars, made.boresight)

    def meter(self) -> Meter:
        return aramis_sky.meter()

    def identify(self, rays: Rays, meter: Meter | None = None, hint: Any = None) -> Found:
        points = aramis_sky.project(rays.astype(np.float64), self.field).astype(np.float32)
        brightness = np.arange(len(rays), 0, -1).astype(np.float32)
        sigma = np.full(len(rays), 0.1, np.float32)
        found = triples.identify(
            StarList(points, brightness, sigma_px=sigma),
            self.field,
            VERIFIED.profile,
            self.database,
            meter or self.meter(),
            hint,
        )
        outcome = {
            Reason.CONFIRMED: MatchOutcome.IDENTIFIED.name,
            Reason.NO_TRIANGLE: MatchOutcome.TOO_FEW_MATCHED.name,
            Reason.TOO_FEW_STARS: MatchOutcome.TOO_FEW_CENTROIDS.name,
        }.get(found.reason, found.reason.name)
        if found.rating is None:
            return Found(found.stars, outcome, np.nan, found.expected, 1.0)
        alarm, scale = found.rating.false_alarm, found.rating.scale
        return Found(found.stars, outcome, alarm, found.expected, scale)
