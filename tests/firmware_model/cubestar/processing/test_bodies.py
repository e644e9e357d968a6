"""Planets and Moon of telecommand SetBody in drawn skies."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.processing.bodies import GOOD_RAD, NO_BODIES
from cubestack.firmware_model.interface.cubestar import Disc, IdMode, MatchMode
from cubestack.firmware_model.interface.cubestar.codes import Reason
from cubestack.firmware_model.interface.cubestar.extensions import FIRST_BODY
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches

from ..harness import Harness
from ..sky import CX, CY, FOCAL_PX, attitude_of, draw, error_deg

MOON_RADIUS_RAD = math.radians(0.26)
PLANET_PX, MOON_PX = (160.0, 330.0), (500.0, 300.0)


@pytest.fixture
def unit(catalogue: StarCatalogue) -> Harness:
    return Harness(catalogue, CubeStarSwitches.of("extended", "bodies=on"))


def inertial(pose: Rotation, pixel: tuple[float, float]) -> NDArray[np.float64]:
    """Direction (3,) that the attitude puts at an undistorted pixel."""
    ray = np.array([(pixel[0] - CX) / FOCAL_PX, (pixel[1] - CY) / FOCAL_PX, 1.0])
    return np.asarray(pose.inv().apply(ray / np.linalg.norm(ray)))


def list_body(
    unit: Harness,
    direction: NDArray[np.float64],
    number: int = 0,
    *,
    radius: float = 0.0,
    accuracy: float = 5e-5,
    minutes: int = 60,
) -> None:
    x, y, z = direction
    places = {"RightAscension": math.atan2(y, x), "Declination": math.asin(z)}
    unit.command(
        "SetBody", Number=number, **places, Radius=radius, Accuracy=accuracy, Minutes=minutes
    )


def stars_and(
    unit: Harness, pose: Rotation, direction: NDArray[np.float64], most: int | None = None
) -> NDArray[np.uint8]:
    """A picture of a planet and of the catalogue's stars, at most ``most``."""
    stars = unit.catalogue.vectors[draw(unit.catalogue.vectors, pose, most).stars]
    return draw(np.concatenate([stars, direction[None].astype(np.float32)]), pose).picture


def moonlit(picture: NDArray[np.uint8], pixel: tuple[float, float]) -> NDArray[np.uint8]:
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]]
    lit = picture.copy()
    lit[np.hypot(x - pixel[0], y - pixel[1]) <= 8] = 255
    return lit


def seen(unit: Harness, picture: NDArray[np.uint8]) -> dict[str, float]:
    unit.picture = picture
    unit.command("CaptureAndProcess")
    return unit.telemetry("Bodies")


def names(unit: Harness) -> list[int]:
    count = int(unit.telemetry("NumIdStars")["numIdStars"])
    return [int(unit.telemetry("HipparcosNumber")["Hipparcos"]) for _ in range(count)]


def valid(unit: Harness) -> bool:
    return bool(unit.telemetry("AttitudeQuaternion")["Valid"])


def test_planet_is_named_and_used(unit: Harness, pose: Rotation) -> None:
    planet = inertial(pose, PLANET_PX)
    picture = stars_and(unit, pose, planet)
    plain = seen(unit, picture)
    stars = len(names(unit))
    assert plain == NO_BODIES
    list_body(unit, planet, number=3)
    values = seen(unit, picture)
    assert (values["Listed"], values["Named"], values["Used"]) == (1, 1, 1)
    assert names(unit).count(FIRST_BODY + 3) == 1
    assert len(names(unit)) == stars + 1
    assert error_deg(attitude_of(unit.telemetry("AttitudeQuaternion")), pose) < 0.01


def test_planet_that_is_known_badly_is_left_out_of_the_attitude(
    unit: Harness, pose: Rotation
) -> None:
    planet = inertial(pose, PLANET_PX)
    picture = stars_and(unit, pose, planet)
    seen(unit, picture)
    without = attitude_of(unit.telemetry("AttitudeQuaternion"))
    shifted = Rotation.from_rotvec([0, 0, 8e-4]).apply(planet)
    list_body(unit, shifted, accuracy=1.01 * GOOD_RAD)
    values = seen(unit, picture)
    assert (values["Named"], values["Used"]) == (1, 0)
    assert error_deg(attitude_of(unit.telemetry("AttitudeQuaternion")), without) < 2e-4


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_one_star_and_a_planet_are_tracked(
    catalogue: StarCatalogue, pose: Rotation, profile: str
) -> None:
    """Two objects are enough where the last attitude is known (section 4.5)."""
    unit = Harness(catalogue, CubeStarSwitches.of(profile, "bodies=on,tracking=nearest"))
    unit.command("setIDMode", IdMode=IdMode.TRACKING)
    planet = inertial(pose, PLANET_PX)
    hint = pose.inv().as_matrix()[:, 2]
    unit.command(
        "setTrackingMode",
        RightAscension=math.atan2(hint[1], hint[0]),
        Declination=math.asin(hint[2]),
    )
    unit.picture = draw(catalogue.vectors, pose).picture
    unit.command("CaptureAndProcess")
    assert valid(unit)
    alone = stars_and(unit, pose, planet, most=1)
    list_body(unit, planet)
    values = seen(unit, alone)
    assert unit.program.commands.processing.results.mode is MatchMode.TRACKING
    assert values["Named"] == 1
    assert valid(unit)
    assert error_deg(attitude_of(unit.telemetry("AttitudeQuaternion")), pose) < 0.02


def test_body_whose_time_is_over_is_not_listed(unit: Harness, pose: Rotation) -> None:
    planet = inertial(pose, PLANET_PX)
    picture = stars_and(unit, pose, planet)
    list_body(unit, planet, minutes=1)
    assert seen(unit, picture)["Listed"] == 1
    unit.run(until_us=unit.now_us + 61_000_000)
    assert seen(unit, picture) == NO_BODIES


def test_removal_reset_and_power_off_empty_the_list(unit: Harness, pose: Rotation) -> None:
    planet = inertial(pose, PLANET_PX)
    for forget in ("zero minutes", "Reset", "power"):
        list_body(unit, planet)
        assert unit.program.state.bodies[0].until_s > 0
        if forget == "zero minutes":
            list_body(unit, planet, minutes=0)
        elif forget == "Reset":
            unit.command("Reset")
        else:
            unit.power_on()
        assert unit.program.state.bodies[0].until_s == 0, forget


def test_moon_confirms_a_right_attitude(unit: Harness, pose: Rotation) -> None:
    """The picture is drawn with distortion, the Moon at its undistorted place: within 20 px."""
    direction = inertial(pose, MOON_PX)
    where = draw(direction[None].astype(np.float32), pose).pixels[0]
    picture = moonlit(draw(unit.catalogue.vectors, pose).picture, tuple(where))
    list_body(unit, direction, radius=MOON_RADIUS_RAD)
    values = seen(unit, picture)
    assert values["Disc"] == Disc.CONFIRMED
    assert values["DiscApart"] < 0.002
    assert (values["DiscX"], values["DiscY"]) == pytest.approx(tuple(where), abs=2)
    assert valid(unit)


def test_moon_elsewhere_refuses_the_attitude(unit: Harness, pose: Rotation) -> None:
    away = draw(inertial(pose, (800.0, 300.0))[None].astype(np.float32), pose).pixels[0]
    picture = moonlit(draw(unit.catalogue.vectors, pose).picture, tuple(away))
    list_body(unit, inertial(pose, MOON_PX), radius=MOON_RADIUS_RAD)
    assert seen(unit, picture)["Disc"] == Disc.MISPLACED
    assert not valid(unit)
    assert unit.telemetry("Quality")["Reason"] == Reason.CONTRADICTION


def test_cut_disc_refuses_only_what_is_far_away(unit: Harness, pose: Rotation) -> None:
    picture = moonlit(draw(unit.catalogue.vectors, pose).picture, (3.0, 300.0))
    list_body(unit, inertial(pose, (30.0, 300.0)), radius=MOON_RADIUS_RAD)
    assert seen(unit, picture)["Disc"] == Disc.SEEN
    assert valid(unit)
    list_body(unit, inertial(pose, MOON_PX), radius=MOON_RADIUS_RAD)
    assert seen(unit, picture)["Disc"] == Disc.MISPLACED
    assert not valid(unit)


def test_dark_sky_where_the_moon_must_be_refuses_the_attitude(
    unit: Harness, pose: Rotation
) -> None:
    list_body(unit, inertial(pose, MOON_PX), radius=MOON_RADIUS_RAD)
    assert seen(unit, draw(unit.catalogue.vectors, pose).picture)["Disc"] == Disc.ABSENT
    assert not valid(unit)


def test_moon_behind_the_camera_changes_nothing(unit: Harness, pose: Rotation) -> None:
    list_body(unit, -inertial(pose, MOON_PX), radius=MOON_RADIUS_RAD)
    assert seen(unit, draw(unit.catalogue.vectors, pose).picture)["Disc"] == Disc.NOT_SEEN
    assert valid(unit)


def test_false_stars_beside_the_moon_are_dropped(unit: Harness, pose: Rotation) -> None:
    direction = inertial(pose, MOON_PX)
    where = draw(direction[None].astype(np.float32), pose).pixels[0]
    picture = moonlit(draw(unit.catalogue.vectors, pose).picture, tuple(where))
    x, y = np.round(where).astype(int)
    picture[y - 13 : y - 10, x - 1 : x + 2] = 90
    list_body(unit, direction, radius=MOON_RADIUS_RAD)
    seen(unit, picture)
    places = unit.program.commands.processing.results.detection.centroids
    assert np.hypot(*(places - where).T).min() > 14


def test_off_ignores_the_list(catalogue: StarCatalogue, pose: Rotation) -> None:
    counts = []
    for listed in (True, False):
        unit = Harness(catalogue, CubeStarSwitches.of("extended"))
        if listed:
            list_body(unit, inertial(pose, PLANET_PX))
        before = unit.meter.counts.copy()
        assert seen(unit, draw(catalogue.vectors, pose).picture) == NO_BODIES
        counts.append(unit.meter.counts - before)
    assert counts[0] == counts[1]
