"""Random pictures of the sky as lists of stars, and what an attitude found in them is worth."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters, build_database
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.solution import NONE, Solution, StarList
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.experiments import attitude

Array = NDArray[np.float64]

FALSE_STAR = 0  #: Stands for the Hipparcos number of a star that does not exist

FIELD = CameraField()

_build = lru_cache(maxsize=4)(build_database)


def meter() -> Meter:
    return Meter(BLACKFIN_BF533)


def database(parameters: CatalogueParameters | None = None) -> Database:
    return _build(parameters or CatalogueParameters())


@dataclass(frozen=True)
class Light:
    """What a list has beside its stars."""

    noise_px: float = 0.1  #: standard deviation of a centroid in x and in y
    mag_noise: float = 0.1  #: standard deviation of a magnitude
    mag_limit: float = 6.0  #: fainter stars do not show
    false_stars: int = 0  #: lights that are no stars, anywhere in the field
    false_mags: tuple[float, float] = (4.5, 6.0)  #: their magnitudes
    most: int = 30  #: number of brightest stars in the list


@dataclass(frozen=True)
class Picture:
    """A list of stars and the truth about it: attitude, and Hipparcos number of each star."""

    stars: StarList
    attitude: Rotation
    hip: NDArray[np.int32]

    @property
    def boresight(self) -> Array:
        return np.asarray(self.attitude.inv().apply([0.0, 0.0, 1.0]))

    def hint(self, error_deg: float, rng: np.random.Generator) -> NDArray[np.float32]:
        """A direction that is so far from the boresight."""
        boresight = self.boresight
        aside = np.cross(boresight, rng.normal(size=3))
        aside /= np.linalg.norm(aside)
        angle = np.radians(error_deg)
        return np.asarray(np.cos(angle) * boresight + np.sin(angle) * aside, dtype=np.float32)


def project(directions: Array, field: CameraField) -> Array:
    """Pixels (n, 2) of camera directions (n, 3) in front of the camera."""
    tangents = directions[:, :2] / directions[:, 2:]
    return np.asarray(tangents / field.scale + field.centre)


def within(points: Array, field: CameraField) -> NDArray[np.bool_]:
    x, y = (points - field.centre).T
    if field.round:
        return np.asarray(np.hypot(x * field.pitch_x_mm, y * field.pitch_y_mm) <= field.radius_mm)
    return np.asarray((abs(x) <= field.columns / 2) & (abs(y) <= field.rows / 2))


def picture(rng: np.random.Generator, field: CameraField, light: Light | None = None) -> Picture:
    light = light or Light()
    sky = load_sky(mag_limit=light.mag_limit)
    pose = Rotation.random(random_state=rng)
    camera = sky.vectors @ pose.as_matrix().T
    ahead = camera[:, 2] > field.smallest_cosine - 1e-6
    points = project(camera[ahead], field)
    seen = within(points, field)
    points, magnitudes, hip = points[seen], sky.v_mag[ahead][seen], sky.hip[ahead][seen]
    points = points + rng.normal(0, light.noise_px, points.shape)
    magnitudes = magnitudes + rng.normal(0, light.mag_noise, len(magnitudes))
    false = np.zeros((0, 2))
    while len(false) < light.false_stars:
        more = rng.uniform(0, 1, (light.false_stars, 2)) * (field.columns, field.rows)
        false = np.concatenate([false, more[within(more, field)]])[: light.false_stars]
    points = np.concatenate([points, false])
    magnitudes = np.concatenate([magnitudes, rng.uniform(*light.false_mags, light.false_stars)])
    hip = np.concatenate([hip, np.full(light.false_stars, FALSE_STAR)])
    order = np.argsort(magnitudes)[: light.most]
    brightness = 500 * 10 ** (-0.4 * (magnitudes[order] - 6))
    stars = StarList(points[order].astype(np.float32), brightness.astype(np.float32))
    return Picture(stars, pose, hip[order].astype(np.int32))


def pictures(count: int, seed: int = 0, light: Light | None = None) -> list[Picture]:
    rng = np.random.default_rng(seed)
    return [picture(rng, FIELD, light) for _ in range(count)]


def errors_deg(quaternion: NDArray[np.float32], truth: Rotation) -> tuple[float, float]:
    """Cross and roll error: between the boresights, and about them."""
    turn = (Rotation.from_quat(quaternion.astype(np.float64)) * truth.inv()).as_matrix()
    cross = np.degrees(np.arctan2(np.hypot(turn[2, 0], turn[2, 1]), turn[2, 2]))
    roll = np.degrees(np.arctan2(turn[0, 1] - turn[1, 0], turn[0, 0] + turn[1, 1]))
    return float(cross), float(abs(roll))


def is_right(solution: Solution, truth: Rotation) -> bool:
    found = solution.quaternion
    return found is not None and attitude.is_right(*errors_deg(found, truth))


def in_published_sense(solution: Solution, made: Picture, database: Database) -> bool:
    """The thesis' own criterion (appendix E): the triangle's middle is less than a field's diameter
    from the boresight."""
    stars = solution.stars[solution.stars != NONE][:3]
    middle = database.vectors[stars].mean(axis=0).astype(np.float64)
    cosine = middle @ made.boresight / np.linalg.norm(middle)
    return bool(np.degrees(np.arccos(np.clip(cosine, -1, 1))) <= database.fov_deg)
