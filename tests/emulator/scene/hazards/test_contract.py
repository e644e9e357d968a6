from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.emulator.camera.common.exposure import camera_state, star_light
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.scene_file import hazard_tables
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.camera.mt9m001.lens import double_gauss
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards import SKY_HAZARDS
from cubestack.emulator.scene.hazards import contract as sky
from cubestack.emulator.scene.hazards.hazard import Hazard, Strength
from cubestack.emulator.scene.hazards.moon import Moon
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.values import number, whole
from tests.emulator.scene.hazards.around import NOW, ORION, SHUTTER
from tests.tiers import quick

AXES = Rotation.from_euler("zyx", [50, -20, 10], degrees=True).as_matrix()
ROUND = sky.CameraState(AXES, 40, 20, 15, 1e-3)


def off_axis_deg(state: sky.CameraState, vector: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(state.boresight @ vector, -1, 1))))


@pytest.mark.parametrize(
    ("values", "vector"),
    [
        ((0, 0), (1, 0, 0)),
        ((90, 0), (0, 1, 0)),
        ((-90, 0), (0, -1, 0)),
        ((360, 0), (1, 0, 0)),
        ((-360, 0), (1, 0, 0)),
        ((123, 90), (0, 0, 1)),
        ((123, -90), (0, 0, -1)),
        ((45, 45), (0.5, 0.5, np.sqrt(0.5))),
        ((0, 0, 5), (0, 0, 1)),
        ((3, 0, 4), (0.6, 0, 0.8)),
        ((0, -1e-9, 0), (0, -1, 0)),
    ],
)
def test_direction_is_a_vector_or_two_angles(values: Any, vector: Any) -> None:
    np.testing.assert_allclose(sky.direction("it", values), vector, atol=1e-12)


ANGLES = "a right ascension of -360 to 360 deg and a declination of -90"
NUMBERS = "3 numbers, not all 0, or right ascension and declination"


@pytest.mark.parametrize(
    ("right", "values"),
    [
        *((ANGLES, values) for values in ((360.1, 0), (-360.1, 0), (0, 90.1), (0, -90.1))),
        *((NUMBERS, values) for values in ((np.nan, 0), (np.inf, 0, 0), (1,), (1, 2, 3, 4))),
        (NUMBERS, (0, 0, 0)),
    ],
)
def test_rejects_invalid_directions(right: str, values: Any) -> None:
    with pytest.raises(SceneError, match=f"it must be {right}"):
        sky.direction("it", values)


def test_angle_between_vectors_is_exact_for_small_angles() -> None:
    for angle in (1e-9, 1e-4, 1.0, 3.0, np.pi):
        vectors = np.array([[np.cos(angle), np.sin(angle), 0.0], [1.0, 0.0, 0.0]])
        expected = [angle, 0.0]
        found = sky.angles_rad(vectors, np.array([1.0, 0, 0]))
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-15)


def test_random_directions_cover_the_whole_field() -> None:
    generator = np.random.default_rng(2)
    vectors = np.array([ROUND.random_direction(generator) for _ in range(2000)])
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1)
    x, y, z = AXES @ vectors.T
    angle = np.degrees(np.arccos(z))
    across, down = angle * x / np.hypot(x, y), angle * y / np.hypot(x, y)
    assert angle.max() <= 15 + 1e-9
    assert angle.max() > 14.5  # the half field, which is less than half of the width
    assert np.abs(down).max() <= 10 + 1e-9
    for values, half in ((across, 15), (down, 10)):
        assert abs(values.mean()) < 0.05 * half
        assert values.max() > 0.95 * half
        assert values.min() < -0.95 * half


@pytest.mark.parametrize("angle_deg", [0.0, 10.0, 90.0, 170.0])
def test_random_directions_at_an_angle_are_uniform_around_the_boresight(angle_deg: float) -> None:
    generator = np.random.default_rng(3)
    places = [ROUND.random_direction_at(angle_deg, generator) for _ in range(200)]
    others = [sky.random_direction_at(ROUND.boresight, angle_deg, generator) for _ in range(200)]
    for found in (places, others):
        for vector in found:
            assert np.linalg.norm(vector) == pytest.approx(1)
            assert off_axis_deg(ROUND, vector) == pytest.approx(angle_deg, abs=1e-5)
        mean = np.mean(found, axis=0) - np.cos(np.radians(angle_deg)) * ROUND.boresight
        assert np.linalg.norm(mean) < 0.2


def test_plain_hazard_has_no_effect() -> None:
    vectors = np.eye(3)
    nothing = sky.SkyHazard()
    assert nothing.lights(ROUND) is nothing.glow(ROUND, vectors) is None
    assert nothing.hidden(ROUND, vectors) is None
    assert (nothing.rings(ROUND), nothing.speed_deg_s, nothing.seed) == ((), 0.0, 0)
    assert nothing.apparent(ROUND, vectors) is vectors
    sky.check_hazards((nothing, Moon()))
    with pytest.raises(SceneError, match="hazards must be hazards of light, not 5"):
        sky.check_hazards((nothing, 5))


def test_earth_radiance_follows_from_its_albedo() -> None:
    """0.3 of the Sun's light on a Lambert surface, by pi; the Sun is V -26.74."""
    assert np.pi * sky.EARTH_RADIANCE / 10 ** (0.4 * 26.74) == pytest.approx(0.3)


@dataclass(frozen=True, kw_only=True)
class Fog(Hazard):
    name: ClassVar[str] = "fog"
    meaning: ClassVar[str] = "water in the air"
    strength: ClassVar[Strength] = Strength("banks", "", (0, 3))

    banks: int = whole(1, "number of banks", 0, 9)
    depth_m: float | None = number(None, "depth of each", 0, 50)
    kind: str = "sea"


def test_sampled_hazard_has_a_reproducible_seed() -> None:
    first, again = (Fog.sample(3.0, None, np.random.default_rng(5)) for _ in range(2))
    assert first == again
    assert first.banks == 3
    assert isinstance(first.banks, int)
    assert first.seed != Fog.sample(3.0, None, np.random.default_rng(6)).seed


KINDS = list(SKY_HAZARDS.values())


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_hazard_has_a_description_strengths_and_defaults(kind: type[sky.SkyHazard]) -> None:
    assert 4 < len(kind.meaning) < 70
    assert 5 <= len(kind.strength.values) <= 7
    assert kind.strength.usual in kind.strength.values
    kind()  # every key has a default


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
@pytest.mark.parametrize("optics", quick([LENS, double_gauss()], 1), ids=["cubestar", "aramis"])
def test_every_strength_renders(kind: type[sky.SkyHazard], optics: Optics) -> None:
    now = camera_state(ORION, optics, SHUTTER)
    for seed, strength in enumerate(kind.strength.values):
        hazard = kind.sample(strength, now, np.random.default_rng(seed))
        light = star_light(replace(ORION, hazards=(hazard,)), optics, SHUTTER)
        assert np.isfinite(light).all()
        assert light.min() >= 0


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_worst_disturbs_more_than_mildest(kind: type[sky.SkyHazard]) -> None:
    now = camera_state(ORION, LENS, SHUTTER)
    clean = star_light(ORION, LENS, SHUTTER)

    def disturbance(strength: float) -> float:
        hazards = (kind.sample(strength, now, np.random.default_rng(k)) for k in range(3))
        scenes = (replace(ORION, hazards=(hazard,)) for hazard in hazards)
        return sum(float(np.abs(star_light(s, LENS, SHUTTER) - clean).sum()) for s in scenes)

    assert disturbance(kind.strength.values[-1]) > disturbance(kind.strength.values[0])


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_sampled_hazard_depends_only_on_the_generator(kind: type[sky.SkyHazard]) -> None:
    first, same, other = (
        kind.sample(kind.strength.usual, NOW, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert first == same
    assert first != other


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_sampled_hazard_round_trips_through_a_file(kind: type[sky.SkyHazard]) -> None:
    hazard = kind.sample(kind.strength.usual, NOW, np.random.default_rng(4))
    assert set(kind.declared()) == {entry.name for entry in fields(kind)}
    values = {entry.name: getattr(hazard, entry.name) for entry in fields(kind)}
    table = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in values.items()
        if value is not None
    }
    assert hazard_tables(SKY_HAZARDS).read({kind.name: table}) == (hazard,)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_lights_move_at_the_declared_rate(kind: type[sky.SkyHazard]) -> None:
    """By that the renderer knows how often to look at them."""
    now = camera_state(ORION, LENS, SHUTTER)
    hazard = kind.sample(kind.strength.usual, now, np.random.default_rng(3))
    here, soon = (hazard.lights(replace(now, time_s=now.time_s + dt)) for dt in (0.0, 1.0))
    if here is None or soon is None:
        assert hazard.speed_deg_s == 0
        return
    chords = np.linalg.norm(soon.vectors - here.vectors, axis=1)
    fastest_deg_s = np.degrees(2 * np.arcsin(chords / 2)).max()
    assert hazard.speed_deg_s == pytest.approx(fastest_deg_s, abs=1e-3)


def test_rejects_scene_hazard_of_wrong_type() -> None:
    with pytest.raises(SceneError, match="hazards must be hazards of light, not 'moon'"):
        SkyScene([0, 0, 0, 1], hazards=("moon",))  # type: ignore[arg-type]
