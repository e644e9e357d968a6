"""Light that comes about in the lens or on the satellite: ghosts and glint."""

import numpy as np
import pytest

from cubestack.emulator.scene.angles import vector_from_angles
from cubestack.emulator.scene.hazards import Ghosts, Glint, Looking
from cubestack.emulator.scene.hazards.contract import SUN_V
from cubestack.emulator.scene.hazards.glint import SUN_SURFACE

FISHEYE = Looking(np.eye(3), 190, 190, 95, np.radians(0.345))


def grid(half_deg: float, step_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Angles (n, 2) and their unit vectors (n, 3)."""
    ticks = np.arange(-half_deg, half_deg, step_deg)
    angles = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    return angles, vector_from_angles(*angles.T)


@pytest.mark.parametrize("seed", range(5))
def test_a_ghost_lies_on_the_line_through_axis_and_sun(seed: int) -> None:
    sun = vector_from_angles(30, 40)
    ghost = Ghosts(sun=tuple(sun), count=1, scatter=0.0, seed=seed, share=1e-4)
    angles, vectors = grid(70, 0.2)
    glow = ghost.glow(FISHEYE, vectors)
    a, b = angles[np.argmax(glow)]
    assert a * 40 == pytest.approx(b * 30, abs=20)
    assert -1.15 * 50 < (a * 30 + b * 40) / 50 < 0.55 * 50
    # The whole of it has that share of the Sun's light.
    theta = np.radians(np.hypot(*angles.T))
    solid = np.radians(0.2) ** 2 * np.sinc(theta / np.pi)
    assert (glow * solid).sum() == pytest.approx(1e-4 * 10 ** (-0.4 * SUN_V), rel=0.05)


def test_a_sun_outside_of_the_field_makes_none() -> None:
    _, vectors = grid(80, 4)
    assert not Ghosts(sun=tuple(vector_from_angles(96, 0))).glow(FISHEYE, vectors).any()
    assert not Ghosts().glow(FISHEYE, vectors).any()
    assert Ghosts(sun=tuple(vector_from_angles(94, 0))).glow(FISHEYE, vectors).any()


@pytest.mark.parametrize("seed", range(5))
def test_glint_is_at_the_border_and_turns_with_the_camera(seed: int) -> None:
    angles, vectors = grid(100, 0.5)
    glow = Glint(seed=seed, surface=0.04).glow(FISHEYE, vectors)
    assert glow.max() == pytest.approx(0.04 * SUN_SURFACE)
    assert np.hypot(*angles[glow > 0].T).min() > 0.7 * 95 - 0.17 * 95
    axes = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    axes[2] *= np.linalg.det(axes)
    turned = Looking(axes, 190, 190, 95, FISHEYE.pixel_rad)
    np.testing.assert_allclose(
        Glint(seed=seed, surface=0.04).glow(turned, vectors @ axes), glow, rtol=1e-3, atol=1e9
    )
