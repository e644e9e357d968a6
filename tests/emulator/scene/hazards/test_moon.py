import math
from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.camera.common.exposure import camera_state, star_light, star_pixels
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards.aberration import Aberration
from cubestack.emulator.scene.hazards.debris import Debris
from cubestack.emulator.scene.hazards.earth_limb import EarthLimb
from cubestack.emulator.scene.hazards.moon import RADIUS_RAD, Moon
from cubestack.emulator.scene.hazards.planets import MAGNITUDES, Planets
from cubestack.emulator.scene.hazards.sun_glare import aureole
from cubestack.emulator.scene.sky import SkyScene
from tests.emulator.scene.hazards.around import NOW, ORION, SHUTTER, whole_light

CENTRE = tuple(NOW.boresight)


def moon_at_phase(phase_deg: float) -> Moon:
    angle = math.radians(180 - phase_deg)
    sun = math.cos(angle) * NOW.boresight + math.sin(angle) * NOW.axes[0]
    return Moon(direction=CENTRE, sun=tuple(sun), scatter=0.0)


@pytest.mark.parametrize(
    ("phase_deg", "v_mag"),
    [(0, -12.73), (90, -10.13), (150, -6.81)],  # Allen's formula, worked by hand
)
def test_moon_disc_light_adds_up_to_its_magnitude(phase_deg: float, v_mag: float) -> None:
    moon = moon_at_phase(phase_deg)
    assert moon.phase_deg == pytest.approx(phase_deg, abs=1e-6)
    assert moon.v_mag == pytest.approx(v_mag, abs=0.01)
    whole = whole_light(moon, replace(NOW, pixel_rad=1e-5), NOW.boresight, 1.1 * RADIUS_RAD)
    assert -2.5 * math.log10(whole) == pytest.approx(v_mag, abs=0.02)


def test_moon_image_holds_its_electrons() -> None:
    moon = moon_at_phase(90)
    dark = SkyScene(ORION.quaternion, mag_limit=-2, hazards=(moon,))
    light = star_light(dark, LENS, SHUTTER)
    right = float(LENS.electrons_per_second(moon.v_mag)) * SHUTTER.exposure_s
    assert light.sum(dtype=np.float64) == pytest.approx(right, rel=0.02)


def test_lit_side_is_towards_the_sun() -> None:
    vectors = NOW.boresight + 0.8 * RADIUS_RAD * np.array([NOW.axes[0], -NOW.axes[0]])
    vectors /= np.linalg.norm(vectors, axis=1)[:, None]
    lit, dark = moon_at_phase(90).glow(NOW, vectors)
    assert lit > 0
    assert dark == 0


def test_full_moon_is_uniform_with_3_4_mag_per_arcsec2() -> None:
    centre = NOW.boresight[None]
    edge = NOW.boresight + 0.7 * RADIUS_RAD * NOW.axes[1]
    full = Moon(direction=CENTRE, scatter=0.0)
    middle = full.glow(NOW, centre)[0]
    assert full.glow(NOW, edge[None] / np.linalg.norm(edge))[0] == pytest.approx(middle, rel=1e-3)
    # -12.73 + 2.5 log10(pi 932.8^2), its area in square arcseconds
    assert -2.5 * math.log10(middle / 4.2545e10) == pytest.approx(3.36, abs=0.02)


def test_aureole_contains_the_declared_share_of_light() -> None:
    angles = np.linspace(0, math.radians(44.9), 100_001)
    share = np.trapezoid(aureole(angles, 0.1) * 2 * math.pi * np.sin(angles), angles)
    assert share == pytest.approx(0.1, rel=0.1)


def test_moon_hides_the_stars_behind() -> None:
    hip, pixels = star_pixels(ORION, LENS, SHUTTER)
    behind = int(np.argmin(np.hypot(*(pixels - [512, 256]).T)))
    vector = LENS.unproject(pixels[behind][None])[0] @ NOW.axes
    moon = Moon(direction=tuple(vector))
    left, _ = star_pixels(SkyScene(ORION.quaternion, hazards=(moon,)), LENS, SHUTTER)
    assert set(hip) - set(left) >= {hip[behind]}
    assert len(left) > len(hip) - 20


def test_moon_is_sampled_inside_the_image_with_its_phase() -> None:
    generator = np.random.default_rng(3)
    for share in (0.0, 0.2, 1.0):
        moon = Moon.sample(share, NOW, generator)
        x, y = LENS.project((NOW.axes @ np.asarray(moon.direction))[None])[0]
        assert -30 < x < LENS.columns + 30
        assert -30 < y < LENS.rows + 30
        assert (1 + math.cos(math.radians(moon.phase_deg))) / 2 == pytest.approx(share, abs=1e-6)


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
def test_planet_magnitudes_match_almanacs(date: float, planet: str, v_mag: float) -> None:
    lights = Planets(julian_date=date).lights(NOW)
    assert lights.v_mag[list(MAGNITUDES).index(planet)] == pytest.approx(v_mag, abs=0.06)


def test_planets_are_within_9_deg_of_the_ecliptic() -> None:
    lights = Planets().lights(NOW)
    pole = np.array([0, -np.sin(np.radians(23.44)), np.cos(np.radians(23.44))])
    assert len(lights.vectors) == 7
    assert np.all(np.abs(lights.vectors @ pole) < np.sin(np.radians(9)))
    np.testing.assert_allclose(np.linalg.norm(lights.vectors, axis=1), 1)


def test_planet_has_the_light_of_a_star_of_its_magnitude() -> None:
    planet = Planets.sample(-2.0, NOW, np.random.default_rng(1))
    dark = SkyScene(ORION.quaternion, mag_limit=-2.0)
    light = star_light(SkyScene(ORION.quaternion, mag_limit=-2.0, hazards=(planet,)), LENS, SHUTTER)
    right = float(LENS.electrons_per_second(-2.0)) * SHUTTER.exposure_s
    assert (light - star_light(dark, LENS, SHUTTER)).sum() == pytest.approx(right, rel=1e-3)


MIDDLE = camera_state(ORION, LENS, SHUTTER)


def streak(rate_deg_s: float) -> tuple[np.ndarray, Debris]:
    """Light of a lone object of V 0 that crosses the boresight along the rows."""
    hazard = Debris(
        direction=tuple(NOW.boresight.tolist()),
        towards=tuple(NOW.axes[0].tolist()),
        rate_deg_s=rate_deg_s,
        v_mag=0.0,
        at_s=MIDDLE.time_s,
    )
    scene = SkyScene(ORION.quaternion, mag_limit=-2, hazards=(hazard,))
    return star_light(scene, LENS, SHUTTER), hazard


@pytest.mark.parametrize("rate_deg_s", [0.0, 0.3, 2.0])
def test_streak_holds_the_light_of_a_star(rate_deg_s: float) -> None:
    light, _ = streak(rate_deg_s)
    right = float(LENS.electrons_per_second(0.0)) * SHUTTER.exposure_s
    assert light.sum(dtype=np.float64) == pytest.approx(right, rel=2e-3)


def test_debris_streak_length_follows_its_motion() -> None:
    light, hazard = streak(3.0)
    columns = np.arange(LENS.columns)
    across = light.sum(axis=0, dtype=np.float64)
    mean = across @ columns / across.sum()
    spread = np.sqrt(across @ (columns - mean) ** 2 / across.sum())
    ends = [
        hazard.lights(replace(MIDDLE, time_s=MIDDLE.time_s + side)).vectors @ NOW.axes.T
        for side in (-SHUTTER.exposure_s / 2, SHUTTER.exposure_s / 2)
    ]
    first, last = (float(LENS.project(end)[0, 0]) for end in ends)
    middle = float(LENS.project(np.array([[0.0, 0.0, 1.0]]))[0, 0])
    assert mean == pytest.approx(middle, abs=0.5)
    assert (first + last) / 2 == pytest.approx(middle, abs=0.5)
    # A uniform bar, and the spot.
    assert spread == pytest.approx(np.hypot(abs(last - first) / np.sqrt(12), 0.95), rel=0.02)


def test_debris_does_not_change_stars_elsewhere() -> None:
    _, hazard = streak(1.0)
    clean = star_light(ORION, LENS, SHUTTER)
    light = star_light(replace(ORION, hazards=(hazard,)), LENS, SHUTTER)
    far = np.ones_like(clean, bool)
    far[:, 400:] = False
    np.testing.assert_array_equal(light[far], clean[far])


ARCSEC = np.pi / 648_000
RANDOM = np.random.default_rng(5).standard_normal((20_000, 3))
VECTORS = RANDOM / np.linalg.norm(RANDOM, axis=1, keepdims=True)


def shifts_arcsec(hazard: Aberration) -> np.ndarray:
    return np.asarray(np.linalg.norm(hazard.apparent(NOW, VECTORS) - VECTORS, axis=1) / ARCSEC)


def test_aberration_is_20_8_arcsec_and_5_more_with_the_orbit() -> None:
    # 20.50 arcsec at the mean speed, 1.7 % more near perihelion.
    assert shifts_arcsec(Aberration(orbit_km_s=0)).max() == pytest.approx(20.8, abs=0.1)
    still = Aberration(orbit_km_s=0).velocity(0)
    ahead = Aberration(orbit_towards=tuple(still.tolist()))
    assert shifts_arcsec(ahead).max() == pytest.approx(20.8 + 5.2, abs=0.1)


def test_aberration_follows_the_relativistic_formula() -> None:
    speed = 0.01
    hazard = Aberration(velocity_km_s=(0.0, 0.0, speed * 299_792.458))
    moved = hazard.apparent(NOW, VECTORS)
    before, after = VECTORS[:, 2], moved[:, 2]
    np.testing.assert_allclose(after, (before + speed) / (1 + speed * before), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 1)


def test_aberration_shifts_stars_in_the_image() -> None:
    velocity = 38 * NOW.axes[0]
    hazard = Aberration(velocity_km_s=tuple(velocity.tolist()))
    hip, before = star_pixels(ORION, LENS, SHUTTER)
    moved, after = star_pixels(SkyScene(ORION.quaternion, hazards=(hazard,)), LENS, SHUTTER)
    before, after = before[np.isin(hip, moved)], after[np.isin(moved, hip)]
    shift = 38 / 299_792.458 * LENS.focal_length_mm * 1000 / LENS.pixel_pitch_um
    assert np.median(after[:, 0] - before[:, 0]) == pytest.approx(shift, rel=0.2)
    assert abs(np.median(after[:, 1] - before[:, 1])) < 0.2 * shift


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (Moon, {"direction": (0.0, 0.0, 0.0)}, "direction must be 3 numbers"),
        (Moon, {"direction": (10.0, 20.0), "sun": (1.0,)}, "sun must be 3 numbers"),
        (Planets, {"direction": (1.0, 2.0, 3.0, 4.0)}, "direction must be 3 numbers"),
        (EarthLimb, {"sun": (0.0, 0.0, 0.0)}, "sun must be 3 numbers"),
        (
            Aberration,
            {"velocity_km_s": (3e5, 0.0, 0.0)},
            "velocity_km_s of the hazard aberration must be at most",
        ),
        (
            Debris,
            {"direction": (1.0, 0.0, 0.0), "towards": (2.0, 0.0, 0.0)},
            "towards of the hazard debris must not be along direction",
        ),
    ],
)
def test_moon_rejects_invalid_directions(kind: type, values: dict, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        kind(**values)
