from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.scene.earth import angular_radius_deg
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene
from cubestack.emulator.scene.hazards import EARTH_HAZARDS, Clouds, EarthInSunCamera, Terminator
from cubestack.emulator.scene.hazards.hazard import Hazard
from tests.emulator.scene.hazards.looks import NOW


@pytest.mark.parametrize("kind", EARTH_HAZARDS.values(), ids=lambda kind: kind.name)
def test_every_strength_makes_a_scene(kind: type[Hazard]) -> None:
    assert kind.strength.usual in kind.strength.values
    for strength in kind.strength.values:
        hazard = kind.sample(strength, NOW, np.random.default_rng(3))
        assert getattr(hazard, kind.strength.key) == strength
        scene = EarthSunScene(hazards=(hazard,))
        assert np.linalg.norm(scene.sun) == pytest.approx(1)
        assert np.linalg.norm(scene.nadir) == pytest.approx(1)
        again = replace(scene, seed=1)  # made anew, it stands as it did
        np.testing.assert_allclose([scene.sun, scene.nadir], [again.sun, again.nadir])


def test_clouds_have_the_share_and_the_brightness_that_they_should() -> None:
    places = np.random.default_rng(0).standard_normal((40_000, 3)).astype(np.float32)
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    shine = Clouds(cover=0.3, seed=2).shine(places)
    assert np.mean(shine > 1.2) == pytest.approx(0.3, abs=0.06)
    assert shine.min() == pytest.approx(0.12 / 0.3)
    assert shine.max() == pytest.approx(0.6 / 0.3)
    assert np.all(Clouds(contrast=0.0).shine(places) == 1)


def test_the_phase_is_the_angle_of_the_sun() -> None:
    scene = EarthSunScene(nadir=(1, 2, 3), hazards=(Terminator(phase_deg=70.0, towards_deg=33.0),))
    assert -scene.sun @ scene.nadir == pytest.approx(np.cos(np.radians(70)))
    np.testing.assert_allclose(scene.nadir, np.array([1, 2, 3]) / np.sqrt(14))


@pytest.mark.parametrize(("above", "visible"), [(0.5, True), (-0.5, False)])
def test_the_limb_is_beside_the_sun(above: float, visible: bool) -> None:
    scene = EarthSunScene(hazards=(EarthInSunCamera(above_deg=above, towards_deg=80.0),))
    angle = np.degrees(np.arccos(scene.sun @ scene.nadir))
    assert angle == pytest.approx(angular_radius_deg(750) + above)
    assert scene.truth(CameraTarget.SUN, 0).visible is visible
