import numpy as np
import pytest

from cubestack.emulator.camera.common.exposure import star_pixels
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards.aberration import Aberration
from cubestack.emulator.scene.sky import SkyScene
from tests.emulator.scene.hazards.looks import NOW, ORION, SHUTTER

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
