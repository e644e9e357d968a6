"""Hazards as an option: names and strengths that can be, and where a frame gets them."""

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
from cubestack.host.experiments.hazard_options import Asked, around_earth, known, with_hazards

VIEW = SkyView(SkyScene.pointing(84, -1), CONDITION)


def test_a_hazard_is_a_name_and_perhaps_a_strength() -> None:
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
def test_what_is_no_hazard_is_refused(
    options: type[CubeStarOptions | CubeSenseOptions], given: str, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        options(hazard=(given,))


@pytest.mark.parametrize("name", sorted(set(known()) - set(EARTH_HAZARDS)))
def test_every_hazard_goes_where_it_belongs_at_every_strength(name: str) -> None:
    for strength in known()[name].strength.values:
        view = with_hazards(VIEW, (Asked(name, strength),), np.random.default_rng(1))
        assert len(view.scene.hazards) + len(view.condition.hazards) == 1
        assert VIEW.scene.hazards == VIEW.condition.hazards == ()


@pytest.mark.parametrize("camera", CameraTarget)
@pytest.mark.parametrize("name", sorted(known()))
def test_around_the_earth_every_hazard_goes_where_it_belongs(
    name: str, camera: CameraTarget
) -> None:
    kind = known()[name]
    view = random_view(CubeSenseOptions(), Camera(camera), np.random.default_rng(1))
    concerned = camera.name.lower() in getattr(kind, "cameras", ("nadir", "sun"))
    for strength in kind.strength.values:
        made = around_earth(view, camera, (Asked(name, strength),), np.random.default_rng(1))
        added = len(made.scene.hazards) + len(made.condition.hazards)
        assert added == int(concerned)


def test_the_moon_is_in_the_field_of_every_frame() -> None:
    axes = matrix_from_quaternion(VIEW.scene.quaternion)
    places = set()
    for seed in range(20):
        (moon,) = with_hazards(VIEW, (Asked("moon"),), np.random.default_rng(seed)).scene.hazards
        x, y, z = axes @ np.asarray(moon.direction)
        assert abs(np.degrees(np.arctan2(x, z))) < 31
        assert abs(np.degrees(np.arctan2(y, z))) < 20
        places.add((round(x, 6), round(y, 6)))
    assert len(places) == 20
