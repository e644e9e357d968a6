import numpy as np
import pytest

from cubestack.emulator.camera.common.exposure import star_light
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards.planets import MAGNITUDES, Planets
from cubestack.emulator.scene.sky import SkyScene
from tests.emulator.scene.hazards.looks import NOW, ORION, SHUTTER


@pytest.mark.parametrize(
    ("date", "planet", "v_mag"),
    [
        (2452879.5, "mars", -2.88),  # the close opposition of 2003-08-28
        (2459205.26, "jupiter", -1.97),  # 2020-12-21
        (2459205.26, "saturn", 0.63),
        (2458967.5, "venus", -4.5),  # greatest brilliancy of 2020-04-28
        (2452640.5, "saturn", -0.45),  # 2003-01-01, the ring wide open
        (2461041.5, "uranus", 5.6),
        (2461041.5, "neptune", 7.9),
    ],
)
def test_magnitudes_of_almanacs(date: float, planet: str, v_mag: float) -> None:
    lights = Planets(julian_date=date).lights(NOW)
    assert lights.v_mag[list(MAGNITUDES).index(planet)] == pytest.approx(v_mag, abs=0.06)


def test_all_are_near_the_ecliptic() -> None:
    lights = Planets().lights(NOW)
    pole = np.array([0, -np.sin(np.radians(23.44)), np.cos(np.radians(23.44))])
    assert len(lights.vectors) == 7
    assert np.all(np.abs(lights.vectors @ pole) < np.sin(np.radians(9)))
    np.testing.assert_allclose(np.linalg.norm(lights.vectors, axis=1), 1)


def test_one_shines_as_a_star_of_its_magnitude() -> None:
    planet = Planets.sample(-2.0, NOW, np.random.default_rng(1))
    dark = SkyScene(ORION.quaternion, mag_limit=-2.0)
    light = star_light(SkyScene(ORION.quaternion, mag_limit=-2.0, hazards=(planet,)), LENS, SHUTTER)
    right = float(LENS.electrons_per_second(-2.0)) * SHUTTER.exposure_s
    assert (light - star_light(dark, LENS, SHUTTER)).sum() == pytest.approx(right, rel=1e-3)


def test_rejects_a_direction_of_four_numbers() -> None:
    with pytest.raises(SceneError, match="direction must be 3 numbers"):
        Planets(direction=(1.0, 2.0, 3.0, 4.0))
