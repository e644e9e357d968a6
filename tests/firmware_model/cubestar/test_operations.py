from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.detection import DetectionConfig, detect_stars
from cubestack.firmware_model.cubestar.matching import confirmed, voting
from cubestack.firmware_model.cubestar.matching.identification import Identification
from cubestack.firmware_model.cubestar.matching.tracking import track
from cubestack.firmware_model.star_tracker.search import MatchOutcome
from tests.together import together

from ..operations import as_on_record
from .detection.pictures import drawn, spots, taken
from .detection.test_steep import limb, noisy
from .sky import meter, pinhole

Shoot = Callable[..., Any]
Y, X = np.mgrid[0:512, 0:1024]


def large_lights() -> NDArray[np.uint8]:
    image = spots(np.array([[700.0, 300.0], [60.2, 60.4]]), np.array([900.0, 20_000.0]))
    image[(X - 300) ** 2 + (Y - 200) ** 2 < 40**2] += 200
    image[400, 100:400] += 120
    image[50, 900] += 250
    return taken(image + 12)


PICTURES = {
    "stars": drawn("integrated", np.random.default_rng(1))[0],
    "stars on light": drawn("integrated", np.random.default_rng(2), background=40)[0],
    "limb": taken(noisy(limb(30)[0] + spots(limb(30)[1], np.full(12, 700.0)), 3)),
    "large lights": large_lights(),
    "noise": taken(noisy(np.full((512, 1024), 9.0), 4)),
    "dark": np.zeros((512, 1024), np.uint8),
}
SEARCHES = {
    "sampled": DetectionConfig(),
    "plain weights": DetectionConfig(plain_weights=True),
    "every pixel of a part": DetectionConfig(
        step=1, x_start=100, x_end=700, y_start=50, y_end=300, grid_size=7, min_pixels=2
    ),
    "background": DetectionConfig(background=True),
}


@together("search", SEARCHES)
@together("picture", PICTURES)
def test_star_detection_charges_the_recorded_operations(picture: str, search: str) -> None:
    spent = meter()
    found = detect_stars(PICTURES[picture], SEARCHES[search], spent)
    places = found.centroids.astype(float)
    numbers = [len(places), *places.sum(axis=0), int(found.intensities.astype(int).sum())]
    as_on_record(f"CubeStar picture: {picture}, {search}", spent, numbers, 0.01)


def numbers(found: Identification) -> list[float]:
    return [
        [*MatchOutcome].index(found.outcome),
        *found.stars.tolist(),
        *found.votes.astype(int).tolist(),
    ]


SHOTS = {
    "clean": {},
    "false stars": {"false_stars": 6},
    "few": {"most": 4},
    "two": {"most": 2},
    "noisy": {"noise_rad": 9e-4},
}


@together("hinted", [False, True])
@together("shot", SHOTS)
@together("way", ["votes", "confirmed"])
def test_identification_charges_the_recorded_operations(
    catalogue: StarCatalogue, shoot: Shoot, way: str, shot: str, hinted: bool
) -> None:
    spent, taken = meter(), shoot(np.random.default_rng(7), **SHOTS[shot])
    hint = taken.attitude[2].astype(np.float32) if hinted else None
    if way == "votes":
        found = voting.identify(taken.directions, catalogue, spent, boresight=hint)
    else:
        brightness = np.arange(len(taken.stars)) % 5
        found = confirmed.identify(
            taken.directions, brightness, catalogue, pinhole(), spent, boresight=hint
        )
    as_on_record(f"CubeStar list: {shot}, {way}, hinted {hinted}", spent, numbers(found))


@pytest.mark.parametrize("verified", [False, True])
@pytest.mark.parametrize("shot", SHOTS)
def test_tracking_charges_the_recorded_operations(
    catalogue: StarCatalogue, shoot: Shoot, shot: str, verified: bool
) -> None:
    spent, taken = meter(), shoot(np.random.default_rng(7), **SHOTS[shot])
    turn = Rotation.from_rotvec([0.002, -0.001, 0.001]).as_matrix()
    field = pinhole() if verified else None
    last = (turn @ taken.attitude).astype(np.float32)
    found = track(taken.directions, catalogue, last, spent, field=field)
    as_on_record(f"CubeStar tracking: {shot}, verified {verified}", spent, numbers(found))
