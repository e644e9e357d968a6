import numpy as np
import pytest

from cubestack.emulator.camera.common.exposure import star_light
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.attitude import vector_from_angles
from cubestack.emulator.scene.form import bodies_of
from cubestack.emulator.scene.hazards import Ghosts, Glint
from cubestack.emulator.scene.hazards.contract import SUN_V, CameraState
from cubestack.emulator.scene.hazards.glint import SUN_SURFACE
from cubestack.emulator.scene.hazards.sun_glare import SunGlare, aureole
from cubestack.emulator.scene.sky import SkyScene
from tests.emulator.scene.hazards.around import NOW, ORION, SHUTTER

FISHEYE = CameraState(np.eye(3), 190, 190, 95, np.radians(0.345))


def grid(half_deg: float, step_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Angles (n, 2) and their unit vectors (n, 3)."""
    ticks = np.arange(-half_deg, half_deg, step_deg)
    angles = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    return angles, vector_from_angles(*angles.T)


@pytest.mark.parametrize("seed", range(5))
def test_ghost_lies_on_the_line_through_optical_axis_and_sun(seed: int) -> None:
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


def test_sun_outside_the_field_creates_no_ghosts() -> None:
    _, vectors = grid(80, 4)
    assert not Ghosts(sun=tuple(vector_from_angles(96, 0))).glow(FISHEYE, vectors).any()
    assert not Ghosts().glow(FISHEYE, vectors).any()
    assert Ghosts(sun=tuple(vector_from_angles(94, 0))).glow(FISHEYE, vectors).any()


def test_sky_map_shows_the_sun_of_lens_ghosts() -> None:
    sun = vector_from_angles(30, 40)
    (body,) = bodies_of((Ghosts(), Ghosts(sun=tuple(3 * sun))))
    assert (body.name, body.radius_deg) == ("Sun", pytest.approx(0.27, abs=0.01))
    np.testing.assert_allclose(body.direction, sun)
    assert bodies_of((Ghosts(),)) == ()


@pytest.mark.parametrize("seed", range(5))
def test_glint_is_near_the_border_and_fixed_to_the_camera(seed: int) -> None:
    angles, vectors = grid(100, 0.5)
    glow = Glint(seed=seed, surface=0.04).glow(FISHEYE, vectors)
    assert glow.max() == pytest.approx(0.04 * SUN_SURFACE)
    assert np.hypot(*angles[glow > 0].T).min() > 0.7 * 95 - 0.17 * 95
    axes = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    axes[2] *= np.linalg.det(axes)
    turned = CameraState(axes, 190, 190, 95, FISHEYE.pixel_rad)
    same = Glint(seed=seed, surface=0.04).glow(turned, vectors @ axes)
    np.testing.assert_allclose(same, glow, rtol=1e-3, atol=1e9)


@pytest.mark.parametrize("seed", range(3))
def test_each_ghost_has_half_the_light_of_the_last_within_its_ring(seed: int) -> None:
    sun = tuple(vector_from_angles(-20, 35))
    _, vectors = grid(60, 0.6)
    rays = np.concatenate([vectors, [sun]])
    whole = {n: Ghosts(sun=sun, count=n, scatter=0.0, seed=seed) for n in (0, 1, 2, 3, 5)}
    assert not whole[0].glow(FISHEYE, rays).any()
    assert whole[0].rings(FISHEYE) == Ghosts().rings(FISHEYE) == ()
    light = 10 ** (-0.4 * SUN_V)
    for ghosts in whole.values():
        rings = ghosts.rings(FISHEYE)
        assert len(rings) == ghosts.count
        expected = np.zeros(len(rays))
        for number, ring in enumerate(rings):
            # The ring ends where its Gaussian does, four standard deviations out.
            assert ring.inner_rad == 0
            sigma = ring.outer_rad / 4
            assert 0.005 <= np.degrees(sigma) / 95 <= 0.03
            angles = np.arccos(np.clip(rays @ ring.centre, -1, 1))
            peak = 1e-4 * light / 2**number / (2 * np.pi * sigma**2)
            expected += np.where(angles < 4 * sigma, peak * np.exp(-((angles / sigma) ** 2) / 2), 0)
        assert len({ring.outer_rad for ring in rings}) == ghosts.count
        np.testing.assert_allclose(ghosts.glow(FISHEYE, rays), expected, rtol=2e-3, atol=1e3)


def test_ghost_scatter_follows_the_glare_model() -> None:
    sun = vector_from_angles(5, 0)
    _, vectors = grid(30, 1)
    glare = Ghosts(sun=tuple(sun), count=0, scatter=0.02).glow(FISHEYE, vectors)
    angles = np.arccos(np.clip(vectors @ sun, -1, 1))
    expected = 10 ** (-0.4 * SUN_V) * aureole(angles, 0.02)
    np.testing.assert_allclose(glare, expected, rtol=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_glint_bar_size_scales_with_the_half_field(seed: int) -> None:
    """A bar's light is its area's; from its ring comes its diagonal."""
    (ring,) = Glint(seed=seed, count=1).rings(FISHEYE)
    away_deg = np.degrees(np.arccos(ring.centre[2]))
    assert 0.7 * 95 <= away_deg <= 0.98 * 95
    assert ring.inner_rad == 0
    half = np.degrees(ring.outer_rad) / 95  # half length and half width
    assert 0.014 <= half <= 0.17
    # Directions around the bar, even in its plane.
    one = np.cross(ring.centre, [0, 0, 1.0])
    one /= np.linalg.norm(one)
    other = np.cross(ring.centre, one)
    ticks = np.linspace(-1.2, 1.2, 301) * ring.outer_rad
    u, v = (axis.ravel() for axis in np.meshgrid(ticks, ticks))
    rays = np.outer(np.sqrt(1 - u**2 - v**2), ring.centre) + np.outer(u, one) + np.outer(v, other)
    fine = CameraState(np.eye(3), 190, 190, 95, 1e-4)
    share = Glint(seed=seed, count=1, surface=1.0).glow(fine, rays) / SUN_SURFACE
    lit = share > 0.5
    points = np.stack([u[lit], v[lit]])
    # A rectangle's principal moments are the thirds of its squared halves.
    width, length = np.sqrt(3 * np.linalg.eigvalsh(np.cov(points)))
    assert length + width == pytest.approx(ring.outer_rad, rel=0.03)
    assert 0.01 * 0.97 <= np.degrees(length) / 95 <= 0.15 * 1.03
    assert 0.004 * 0.9 <= np.degrees(width) / 95 <= 0.02 * 1.1
    area = lit.sum() * (ticks[1] - ticks[0]) ** 2
    assert area == pytest.approx(4 * length * width, rel=0.04)
    assert share.max() == pytest.approx(1.0)
    # Its edge is a pixel wide, half of it on either side.
    wide = CameraState(np.eye(3), 190, 190, 95, float(width))
    soft = Glint(seed=seed, count=1, surface=1.0).glow(wide, rays) / SUN_SURFACE
    assert soft.sum() == pytest.approx(share.sum(), rel=0.05)
    assert ((soft > 0.05) & (soft < 0.95)).sum() > ((share > 0.05) & (share < 0.95)).sum()


def test_glints_are_uniform_around_the_axis() -> None:
    bars = (Glint(seed=seed, count=50).rings(FISHEYE) for seed in range(20))
    centres = [ring.centre for rings in bars for ring in rings]
    across = np.array(centres)[:, :2]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    assert np.abs(across.mean(axis=0)).max() < 0.08  # 3.5 standard deviations


def at(angle_deg: float, **values: float) -> SunGlare:
    angle = np.radians(angle_deg)
    source = np.cos(angle) * NOW.boresight + np.sin(angle) * NOW.axes[0]
    return SunGlare(direction=tuple(source.tolist()), **values)


def on_boresight(hazard: SunGlare) -> float:
    return float(hazard.glow(NOW, NOW.boresight[None])[0])


def test_glare_transmittance_is_defined_at_45_deg_and_falls_by_decades() -> None:
    sun = 10 ** (-0.4 * SUN_V)
    assert on_boresight(at(45, transmittance=3e-7)) == pytest.approx(3e-7 * sun, rel=1e-5)
    assert on_boresight(at(75, transmittance=3e-7)) == pytest.approx(3e-9 * sun, rel=1e-5)
    moon = at(45, transmittance=3e-7, v_mag=SUN_V + 14)
    assert on_boresight(moon) == pytest.approx(3e-7 * sun * 10**-5.6, rel=1e-4)


def test_sun_glare_slope_across_the_image_is_exponential() -> None:
    scene = SkyScene(ORION.quaternion, mag_limit=-2, hazards=(at(60, slope_deg=20.0),))
    light = star_light(scene, LENS, SHUTTER)
    row = light[256] / light[256, 512]
    assert np.all(np.diff(row) > -1e-3)  # towards the Sun, to the right
    directions = LENS.unproject(np.array([[100.0, 256.0], [900.0, 256.0]]))
    away_deg = np.degrees(np.arccos(directions @ [np.sin(np.pi / 3), 0, np.cos(np.pi / 3)]))
    solid = light[256, 900] / light[256, 100]
    assert solid == pytest.approx(np.exp((away_deg[0] - away_deg[1]) / 20), rel=0.15)


def test_sun_in_the_field_yields_finite_light() -> None:
    light = star_light(SkyScene(ORION.quaternion, hazards=(at(0, transmittance=1),)), LENS, SHUTTER)
    assert np.isfinite(light).all()
    # No baffle gives more than there is.
    assert on_boresight(at(0, transmittance=1)) == pytest.approx(10 ** (-0.4 * SUN_V), rel=1e-5)
