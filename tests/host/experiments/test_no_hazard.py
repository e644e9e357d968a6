"""Where no hazard is asked for, or none can be, a view is as it was."""

from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.experiments.cubesense.measure import CubeSenseOptions, random_view
from cubestack.host.experiments.hazard_options import Asked, around_earth, check, with_hazards

RNG: Any = None  # nothing is drawn


def test_without_a_hazard_nothing_is_drawn_or_changed() -> None:
    view = SkyView(SkyScene.pointing(84, -1), CONDITION)
    assert with_hazards(view, (), RNG) is view
    earth = random_view(CubeSenseOptions(), Camera.SUN, np.random.default_rng(1))
    assert around_earth(earth, CameraTarget.SUN, (), RNG) is earth
    check(())


def test_what_is_no_sky_is_left_as_it_is() -> None:
    picture: Any = SkyView(object(), CONDITION)  # type: ignore[arg-type]
    assert with_hazards(picture, (Asked("moon"),), RNG) is picture


@pytest.mark.parametrize("name", ["clouds", "terminator"])
def test_hazards_of_the_earth_need_one(name: str) -> None:
    check((Asked(name),), earth=True)
    with pytest.raises(ValueError, match=f"hazard: there is no '{name}'; known: "):
        check((Asked(name),))
