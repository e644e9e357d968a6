from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.scene.attitude import matrix_from_quaternion
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.emulator.scene.hazards import EARTH_HAZARDS
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.experiments.cubesense.measure import CubeSenseOptions, random_view
from cubestack.host.experiments.cubestar.measure import CubeStarOptions
from cubestack.host.experiments.hazard_options import (
    Asked,
    around_earth,
    check,
    known,
    with_hazards,
)
from tests.together import together

VIEW = SkyView(SkyScene.pointing(84, -1), CONDITION)


def test_hazard_option_has_a_name_and_an_optional_strength() -> None:
    options = CubeStarOptions(hazard=("moon", "gradient=60"))
    assert options.hazard == (Asked("moon"), Asked("gradient", 60.0))
    assert [str(one) for one in options.hazard] == ["moon", "gradient=60"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("mooon", "hazard: there is no 'mooon'; known: .*moon"),
        ("gradient=steep", "hazard must be NAME or NAME=STRENGTH"),
        ("gradient=-1", "hazard: gradient must be 0 to .*, not -1"),
    ],
)
@pytest.mark.parametrize("options", [CubeStarOptions, CubeSenseOptions])
def test_rejects_unknown_hazards_and_strengths(
    options: type[CubeStarOptions | CubeSenseOptions], given: str, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        options(hazard=(given,))


@together("name", sorted(set(known()) - set(EARTH_HAZARDS)))
def test_hazard_is_added_to_scene_or_condition_at_every_strength(name: str) -> None:
    for strength in known()[name].strength.values:
        view = VIEW
        for count in (1, 2):
            view = with_hazards(view, (Asked(name, strength),), np.random.default_rng(1))
            assert len(view.scene.hazards) + len(view.condition.hazards) == count
        assert VIEW.scene.hazards == VIEW.condition.hazards == ()


@together("camera", CameraTarget)
@together("name", sorted(known()))
def test_earth_hazard_is_added_for_its_cameras_only(name: str, camera: CameraTarget) -> None:
    kind = known()[name]
    view = random_view(CubeSenseOptions(), Camera(camera), np.random.default_rng(1))
    concerned = camera.name.lower() in getattr(kind, "cameras", ("nadir", "sun"))
    for strength in kind.strength.values:
        made = around_earth(view, camera, (Asked(name, strength),), np.random.default_rng(1))
        added = len(made.scene.hazards) + len(made.condition.hazards)
        assert added == int(concerned)


def test_moon_is_in_the_field_of_every_frame() -> None:
    axes = matrix_from_quaternion(VIEW.scene.quaternion)
    places = set()
    for seed in range(20):
        (moon,) = with_hazards(VIEW, (Asked("moon"),), np.random.default_rng(seed)).scene.hazards
        x, y, z = axes @ np.asarray(moon.direction)
        assert abs(np.degrees(np.arctan2(x, z))) < 31
        assert abs(np.degrees(np.arctan2(y, z))) < 20
        places.add((round(x, 6), round(y, 6)))
    assert len(places) == 20


def test_view_is_unchanged_without_hazards() -> None:
    rng: Any = None  # nothing may be drawn
    assert with_hazards(VIEW, (), rng) is VIEW
    earth = random_view(CubeSenseOptions(), Camera.SUN, np.random.default_rng(1))
    assert around_earth(earth, CameraTarget.SUN, (), rng) is earth
    check(())
    picture: Any = SkyView(object(), CONDITION)  # type: ignore[arg-type]
    assert with_hazards(picture, (Asked("moon"),), rng) is picture


@pytest.mark.parametrize("name", ["clouds", "terminator"])
def test_hazards_of_the_earth_are_rejected_for_the_sky(name: str) -> None:
    check((Asked(name),), earth=True)
    with pytest.raises(ValueError, match=f"hazard: there is no '{name}'; known: "):
        check((Asked(name),))
