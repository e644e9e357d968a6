from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.camera.common.exposure import camera_state, star_light, star_pixels
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards.aberration import Aberration
from cubestack.emulator.scene.hazards.debris import Debris
from cubestack.emulator.scene.sky import SkyScene
from tests.emulator.scene.hazards.around import NOW, ORION, SHUTTER

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


def test_streak_is_as_long_as_it_moves() -> None:
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


def test_stars_are_unchanged() -> None:
    _, hazard = streak(1.0)
    clean = star_light(ORION, LENS, SHUTTER)
    light = star_light(replace(ORION, hazards=(hazard,)), LENS, SHUTTER)
    far = np.ones_like(clean, bool)
    far[:, 400:] = False
    np.testing.assert_array_equal(light[far], clean[far])


def test_rejects_path_of_zero_length() -> None:
    with pytest.raises(
        SceneError, match="towards of the hazard debris must not be along direction"
    ):
        Debris(direction=(1.0, 0.0, 0.0), towards=(2.0, 0.0, 0.0))


ARCSEC = np.pi / 648_000
RANDOM = np.random.default_rng(5).standard_normal((20_000, 3))
VECTORS = RANDOM / np.linalg.norm(RANDOM, axis=1, keepdims=True)


def shifts_arcsec(hazard: Aberration) -> np.ndarray:
    return np.asarray(np.linalg.norm(hazard.apparent(NOW, VECTORS) - VECTORS, axis=1) / ARCSEC)


def test_constant_of_aberration() -> None:
    # 20.50 arcsec at the mean speed, 1.7 % more near perihelion.
    assert shifts_arcsec(Aberration(orbit_km_s=0)).max() == pytest.approx(20.8, abs=0.1)


def test_orbit_adds_five_arcsec_at_most() -> None:
    still = Aberration(orbit_km_s=0).velocity(0)
    ahead = Aberration(orbit_towards=tuple(still.tolist()))
    assert shifts_arcsec(ahead).max() == pytest.approx(20.8 + 5.2, abs=0.1)


def test_goes_towards_the_velocity_as_relativity_says() -> None:
    speed = 0.01
    hazard = Aberration(velocity_km_s=(0.0, 0.0, speed * 299_792.458))
    moved = hazard.apparent(NOW, VECTORS)
    before, after = VECTORS[:, 2], moved[:, 2]
    np.testing.assert_allclose(after, (before + speed) / (1 + speed * before), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 1)


def test_moves_stars_in_the_picture() -> None:
    velocity = 38 * NOW.axes[0]
    hazard = Aberration(velocity_km_s=tuple(velocity.tolist()))
    hip, before = star_pixels(ORION, LENS, SHUTTER)
    moved, after = star_pixels(SkyScene(ORION.quaternion, hazards=(hazard,)), LENS, SHUTTER)
    before, after = before[np.isin(hip, moved)], after[np.isin(moved, hip)]
    shift = 38 / 299_792.458 * LENS.focal_length_mm * 1000 / LENS.pixel_pitch_um
    assert np.median(after[:, 0] - before[:, 0]) == pytest.approx(shift, rel=0.2)
    assert abs(np.median(after[:, 1] - before[:, 1])) < 0.2 * shift


def test_rejects_impossible_values() -> None:
    with pytest.raises(SceneError, match="velocity_km_s of the hazard aberration must be at most"):
        Aberration(velocity_km_s=(3e5, 0.0, 0.0))
