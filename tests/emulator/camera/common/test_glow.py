from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from cubestack.emulator.camera.common.exposure import camera_state_for, star_light
from cubestack.emulator.camera.common.glow import brightness, glow_electrons
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.camera.mt9m001.lens import double_gauss
from cubestack.emulator.scene.hazards import SKY_HAZARDS, Moon, SunGlare
from cubestack.emulator.scene.hazards.contract import SkyHazard
from cubestack.emulator.scene.sky import SkyScene
from tests.emulator.scene.hazards.around import ORION, SHUTTER
from tests.tiers import quick

LENSES = [LENS, double_gauss()]
GLOWING = ["moon", "earth-limb", "sun-glare", "sky-glow"]


def placed(name: str, optics: Optics, seed: int) -> SkyHazard:
    kind = SKY_HAZARDS[name]
    now = camera_state_for(ORION.quaternion, optics)
    return kind.sample(kind.strength.usual, now, np.random.default_rng(seed))


@pytest.mark.parametrize("optics", quick(LENSES, 1), ids=["cubestar", "aramis"])
@pytest.mark.parametrize("name", GLOWING)
def test_interpolated_glow_matches_the_exact_value_per_pixel(name: str, optics: Optics) -> None:
    generator = np.random.default_rng(2)
    now = camera_state_for(ORION.quaternion, optics)
    for seed in range(3):
        hazard = placed(name, optics, seed)
        picture = glow_electrons([hazard], [now], optics)
        x, y = (generator.integers(0, size, 3000) for size in (optics.columns, optics.rows))
        directions = optics.unproject(np.stack([x, y], axis=1).astype(np.float64))
        exact = brightness([hazard], now, directions @ now.axes)
        # A pixel's share of the sky: the cube of the cosine but for the lens' distortion.
        corner = optics.unproject(np.stack([x + 1, y], axis=1).astype(np.float64))
        below = optics.unproject(np.stack([x, y + 1], axis=1).astype(np.float64))
        solid = np.linalg.norm(np.cross(corner - directions, below - directions), axis=1)
        right = exact * solid * optics.electrons_per_second(0.0) * optics.even_light[y, x]
        off = np.abs(picture[y, x] - right) / (right + 1e-3 * right.max() + 1e-9)
        assert np.median(off) < 0.005
        assert np.percentile(off, 98) < 0.05  # the rest is blurred, or at the limb


def test_earth_hides_the_moon_but_not_glare() -> None:
    now = camera_state_for(ORION.quaternion, LENS)
    behind = Moon(direction=tuple(now.boresight.tolist()))
    earth = replace(placed("earth-limb", LENS, 0), nadir=behind.direction, airglow=0.0)
    glare = SunGlare(direction=tuple((-now.boresight).tolist()))
    vectors = now.boresight[None]
    alone, both, all_three = (
        brightness(hazards, now, vectors)
        for hazards in ([earth], [behind, earth], [behind, earth, glare])
    )
    assert both[0] == alone[0]
    assert all_three[0] >= both[0]


def test_uniform_glow_equals_sky_brightness_on_axis() -> None:
    glare = SunGlare(direction=tuple(camera_state_for(ORION.quaternion, LENS).boresight.tolist()))
    even = replace(glare, slope_deg=1e6, transmittance=1e-12, decade_deg=180.0)
    scene = SkyScene(ORION.quaternion, mag_limit=-2, hazards=(even,))
    now = camera_state_for(ORION.quaternion, LENS)
    glow = even.glow(now, now.boresight[None])
    light = star_light(scene, LENS, SHUTTER)
    px = LENS.project(np.array([[0.0, 0.0, 1.0]]))[0].astype(int)
    sky = glow[0] * LENS.electrons_per_second(0.0) * LENS.pixel_arcsec2 / 4.2545e10
    # The distortion's slope on the axis is near 1.
    assert light[px[1], px[0]] == pytest.approx(sky * SHUTTER.exposure_s, rel=0.02)


def test_glow_smears_as_the_camera_turns() -> None:
    moon = placed("moon", LENS, 1)
    rate = (0.0, 5.0, 0.0)
    still, turning = (
        star_light(SkyScene(ORION.quaternion, r, mag_limit=-2, hazards=(moon,)), LENS, SHUTTER)
        for r in ((0.0, 0.0, 0.0), rate)
    )
    full = still.max() / 2
    assert (turning > full / 3).sum() > 1.5 * (still > full).sum()


@pytest.mark.parametrize("sigma_px", [0.9, 3.0])
def test_lens_blurs_disc_edges_like_stars(sigma_px: float) -> None:
    optics = replace(LENS, psf_sigma_px=sigma_px)
    now = camera_state_for(ORION.quaternion, optics)
    moon = Moon(direction=tuple(now.boresight.tolist()), scatter=0.0)
    light = glow_electrons([moon], [now], optics)
    sharp = glow_electrons([moon], [now], replace(optics, psf_sigma_px=1e-3))
    assert light.sum(dtype=np.float64) == pytest.approx(sharp.sum(dtype=np.float64), rel=1e-3)
    window = np.s_[146:206, 509:569]  # around the principal point
    blurred = gaussian_filter(sharp[window].astype(np.float64), sigma_px)
    assert sharp[window].max() > 0.9 * sharp.max()
    np.testing.assert_allclose(light[window], blurred, rtol=0, atol=0.005 * sharp.max())


def test_no_glow_without_hazards() -> None:
    now = camera_state_for(ORION.quaternion, LENS)
    assert glow_electrons([], [now], LENS) is None
    assert glow_electrons([placed("aberration", LENS, 0)], [now], LENS) is None
