import numpy as np
import pytest

from cubestack.emulator.camera.common.exposure import star_light
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.hazards.contract import SUN_V
from cubestack.emulator.scene.hazards.sun_glare import SunGlare
from cubestack.emulator.scene.sky import SkyScene
from tests.emulator.scene.hazards.looks import NOW, ORION, SHUTTER


def at(angle_deg: float, **values: float) -> SunGlare:
    angle = np.radians(angle_deg)
    source = np.cos(angle) * NOW.boresight + np.sin(angle) * NOW.axes[0]
    return SunGlare(direction=tuple(source.tolist()), **values)


def on_boresight(hazard: SunGlare) -> float:
    return float(hazard.glow(NOW, NOW.boresight[None])[0])


def test_transmittance_is_that_at_45_deg_and_falls_by_decades() -> None:
    sun = 10 ** (-0.4 * SUN_V)
    assert on_boresight(at(45, transmittance=3e-7)) == pytest.approx(3e-7 * sun, rel=1e-5)
    assert on_boresight(at(75, transmittance=3e-7)) == pytest.approx(3e-9 * sun, rel=1e-5)
    moon = at(45, transmittance=3e-7, v_mag=SUN_V + 14)
    assert on_boresight(moon) == pytest.approx(3e-7 * sun * 10**-5.6, rel=1e-4)


def test_slope_across_the_picture() -> None:
    scene = SkyScene(ORION.quaternion, mag_limit=-2, hazards=(at(60, slope_deg=20.0),))
    light = star_light(scene, LENS, SHUTTER)
    row = light[256] / light[256, 512]
    assert np.all(np.diff(row) > -1e-3)  # towards the Sun, to the right
    directions = LENS.unproject(np.array([[100.0, 256.0], [900.0, 256.0]]))
    away_deg = np.degrees(np.arccos(directions @ [np.sin(np.pi / 3), 0, np.cos(np.pi / 3)]))
    solid = light[256, 900] / light[256, 100]
    assert solid == pytest.approx(np.exp((away_deg[0] - away_deg[1]) / 20), rel=0.15)


def test_sun_in_the_field_is_finite() -> None:
    light = star_light(SkyScene(ORION.quaternion, hazards=(at(0, transmittance=1),)), LENS, SHUTTER)
    assert np.isfinite(light).all()
    # No baffle gives more than there is.
    assert on_boresight(at(0, transmittance=1)) == pytest.approx(10 ** (-0.4 * SUN_V), rel=1e-5)
