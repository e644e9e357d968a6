from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.camera.common.exposure import star_light, star_pixels
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.earth import angular_radius_deg
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene
from cubestack.emulator.scene.hazards import EARTH_HAZARDS, Clouds, EarthInSunCamera, Terminator
from cubestack.emulator.scene.hazards.contract import EARTH_RADIANCE
from cubestack.emulator.scene.hazards.earth_limb import EarthLimb, airglow_s10
from cubestack.emulator.scene.hazards.hazard import Hazard
from cubestack.emulator.scene.hazards.moon import Moon
from cubestack.emulator.scene.hazards.planets import Planets
from cubestack.emulator.scene.hazards.sun_glare import aureole
from cubestack.emulator.scene.sky import SkyScene
from tests.emulator.scene.hazards.around import NOW, ORION, SHUTTER, whole_light

RADIUS_DEG = angular_radius_deg(600.0)


def limb(angle_deg: float, *, lit: bool = True, **values: float) -> EarthLimb:
    """The limb ``angle_deg`` to the right of the boresight, square to the rows."""
    angle = np.radians(angle_deg + RADIUS_DEG)
    nadir = np.cos(angle) * NOW.boresight + np.sin(angle) * NOW.axes[0]
    sun = -nadir if lit else nadir
    return EarthLimb(nadir=tuple(nadir.tolist()), sun=tuple(sun.tolist()), **values)


def beside_boresight(angle_deg: float) -> np.ndarray:
    angle = np.radians(angle_deg)
    return np.asarray((np.cos(angle) * NOW.boresight + np.sin(angle) * NOW.axes[0])[None])


def test_earth_hides_exactly_the_stars_behind_it() -> None:
    hazard = limb(5.0)
    hip, pixels = star_pixels(ORION, LENS, SHUTTER)
    left, _ = star_pixels(replace(ORION, hazards=(hazard,)), LENS, SHUTTER)
    nadir = NOW.axes @ np.array(hazard.nadir)
    behind = LENS.unproject(pixels) @ nadir > np.cos(np.radians(RADIUS_DEG))
    assert 0 < len(left) < len(hip)
    assert set(left) == set(hip[~behind])


def test_no_starlight_comes_through_the_ground() -> None:
    dark = EarthLimb(nadir=tuple(NOW.boresight.tolist()), sun=tuple(NOW.boresight.tolist()))
    light = star_light(replace(ORION, hazards=(replace(dark, airglow=0.0),)), LENS, SHUTTER)
    assert light.max() < 0.1


def test_lit_ground_has_the_radiance_of_the_mean_earth() -> None:
    hazard = limb(-RADIUS_DEG, unevenness=0.0, airglow=0.0)  # straight down, the Sun overhead
    assert hazard.glow(NOW, NOW.boresight[None])[0] == pytest.approx(EARTH_RADIANCE, rel=2e-3)
    # 0.3 of the Sun's 1361 W/m2, by pi: the Sun is V -26.74 by 4.2545e10 for an arcsec2.
    mag = -2.5 * np.log10(EARTH_RADIANCE / 4.2545e10)
    assert mag == pytest.approx(2.38, abs=0.01)


def test_earth_light_from_far_away_matches_lambert() -> None:
    # At an angle from nadir, Lambert's ground is lit by the cosine of the way there on the sphere.
    hazard = replace(limb(0, unevenness=0.0, airglow=0.0, glow_km=0.0), altitude_km=40_000.0)
    nadir = np.array(hazard.nadir)
    radius = np.radians(angular_radius_deg(40_000.0))
    angles = np.linspace(0, radius, 10_001)
    way = np.arcsin(np.sin(angles) / np.sin(radius)) - angles
    right = np.trapezoid(np.cos(way) * 2 * np.pi * np.sin(angles), angles) * EARTH_RADIANCE
    light = whole_light(hazard, replace(NOW, pixel_rad=1e-5), nadir, radius * 1.01)
    assert light == pytest.approx(right, rel=0.01)


def test_earth_limb_light_ends_at_the_limb() -> None:
    hazard = limb(5.0, lit=True, airglow=0.0, glow_km=0.0)
    inside, outside = (hazard.glow(NOW, beside_boresight(5.0 + d))[0] for d in (0.2, -0.2))
    assert inside > 1e-3 * EARTH_RADIANCE
    assert outside == 0
    light = star_light(SkyScene(ORION.quaternion, mag_limit=-2, hazards=(hazard,)), LENS, SHUTTER)
    edge = float(LENS.project(beside_boresight(5.0) @ NOW.axes.T)[0, 0])
    row = light[256]
    assert row[round(edge) + 8] > 1000 * max(row[round(edge) - 8], 1)


def test_night_side_is_dark_but_for_the_airglow() -> None:
    assert limb(5.0, lit=False, airglow=0.0).glow(NOW, beside_boresight(20.0))[0] < 0.1
    glows = limb(5.0, lit=False).glow(NOW, np.concatenate([beside_boresight(a) for a in (4, 20)]))
    assert np.all(glows > 10)


def test_airglow_brightness_at_nadir_and_along_the_limb() -> None:
    height = np.array([-6378.136, 90.0, 94.0, 130.0])
    down, limb_90, limb_94, above = airglow_s10(height, np.array([True, False, False, False]))
    assert down == pytest.approx(145, rel=0.01)
    # A shell of 10 km: 2 sqrt(2 R h) of way, some 70 times the layer's depth.
    assert 5000 < limb_94 < 12_000
    assert 5000 < limb_90 < 12_000
    assert above == 0


def test_scattered_earth_light_falls_off_beside_the_limb() -> None:
    clean, dirty = limb(5.0, airglow=0.0), limb(5.0, airglow=0.0, scatter=0.01)
    near, far = (dirty.glow(NOW, beside_boresight(a))[0] for a in (0.0, -25.0))
    assert clean.glow(NOW, beside_boresight(0.0))[0] == 0
    assert near > far > 0


def test_earth_hides_moon_and_planets() -> None:
    hazard = limb(5.0, lit=False, airglow=0.0)
    for angle_deg, shines in ((20.0, False), (-10.0, True)):
        place = tuple(beside_boresight(angle_deg)[0].tolist())
        behind = (Planets(direction=place), Moon(direction=place, scatter=0.0), hazard)
        scene = SkyScene(ORION.quaternion, mag_limit=-2, hazards=behind)
        light = star_light(scene, LENS, SHUTTER)
        x, y = LENS.project(beside_boresight(angle_deg) @ NOW.axes.T)[0].astype(int)
        assert bool(light[y - 3 : y + 4, x - 3 : x + 4].max() > 1000) is shines


def test_scattered_earth_light_is_the_sum_over_the_ground() -> None:
    hazard = limb(5.0, airglow=0.0, scatter=0.01)
    hazard = replace(hazard, sun=tuple((NOW.axes[1] - 0.3 * NOW.boresight).tolist()))
    generator = np.random.default_rng(6)
    # Random directions, each for as much of the sphere.
    sky = generator.standard_normal((400_000, 3))
    sky /= np.linalg.norm(sky, axis=1, keepdims=True)
    ground = hazard.ground(sky) * 4 * np.pi / len(sky)
    for angle_deg in (-5.0, -15.0, -30.0):
        vector = beside_boresight(angle_deg)
        right = ground @ aureole(np.arccos(np.clip(sky @ vector[0], -1, 1)), 0.01)
        assert hazard.glow(NOW, vector)[0] == pytest.approx(right, rel=0.05)


@pytest.mark.parametrize("angle_deg", [45.0, 5.0, 0.0, -10.0])
def test_earth_limb_is_sampled_at_an_angle_from_the_boresight(angle_deg: float) -> None:
    hazard = EarthLimb.sample(angle_deg, NOW, np.random.default_rng(8))
    to_nadir = np.degrees(np.arccos(np.array(hazard.nadir) @ NOW.boresight))
    assert to_nadir - RADIUS_DEG == pytest.approx(angle_deg, abs=1e-6)
    assert np.array(hazard.sun) @ NOW.boresight <= 0.5 + 1e-9


def test_earth_ring_extends_two_coarse_pixels_beyond_the_disc() -> None:
    """Where a pixel is wider than all that shines above the limb."""
    coarse = replace(NOW, pixel_rad=np.radians(5.0))
    (ring,) = limb(5.0).rings(coarse)
    assert np.degrees(ring.inner_rad) == pytest.approx(RADIUS_DEG - 10)
    assert np.degrees(ring.outer_rad) == pytest.approx(RADIUS_DEG + 10)


@pytest.mark.parametrize("kind", EARTH_HAZARDS.values(), ids=lambda kind: kind.name)
def test_every_strength_of_earth_hazards_yields_a_valid_scene(kind: type[Hazard]) -> None:
    assert kind.strength.usual in kind.strength.values
    for strength in kind.strength.values:
        hazard = kind.sample(strength, NOW, np.random.default_rng(3))
        assert getattr(hazard, kind.strength.key) == strength
        scene = EarthSunScene(hazards=(hazard,))
        assert np.linalg.norm(scene.sun) == pytest.approx(1)
        assert np.linalg.norm(scene.nadir) == pytest.approx(1)
        again = replace(scene, seed=1)  # made anew, it stands as it did
        np.testing.assert_allclose([scene.sun, scene.nadir], [again.sun, again.nadir])


def test_clouds_have_the_requested_cover_and_brightness() -> None:
    places = np.random.default_rng(0).standard_normal((40_000, 3)).astype(np.float32)
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    shine = Clouds(cover=0.3, seed=2).shine(places)
    assert np.mean(shine > 1.2) == pytest.approx(0.3, abs=0.06)
    assert shine.min() == pytest.approx(0.12 / 0.3)
    assert shine.max() == pytest.approx(0.6 / 0.3)
    assert np.all(Clouds(contrast=0.0).shine(places) == 1)


def test_terminator_phase_is_the_sun_angle() -> None:
    scene = EarthSunScene(nadir=(1, 2, 3), hazards=(Terminator(phase_deg=70.0, towards_deg=33.0),))
    assert -scene.sun @ scene.nadir == pytest.approx(np.cos(np.radians(70)))
    np.testing.assert_allclose(scene.nadir, np.array([1, 2, 3]) / np.sqrt(14))


@pytest.mark.parametrize(("above", "visible"), [(0.5, True), (-0.5, False)])
def test_earth_limb_hazard_lies_beside_the_sun(above: float, visible: bool) -> None:
    scene = EarthSunScene(hazards=(EarthInSunCamera(above_deg=above, towards_deg=80.0),))
    angle = np.degrees(np.arccos(scene.sun @ scene.nadir))
    assert angle == pytest.approx(angular_radius_deg(750) + above)
    assert scene.truth(CameraTarget.SUN, 0).visible is visible
