from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from cubestack.emulator.camera.common.hazards import (
    HAZARDS,
    Background,
    Defocus,
    FocalLength,
    Gradient,
    HotPixels,
    LensResiduals,
    Protons,
)
from cubestack.emulator.camera.common.hazards.contract import SensorHazard
from cubestack.emulator.camera.ov7620.fisheye import lens_of
from cubestack.emulator.camera.ov7620.lens_error import NOMINAL
from cubestack.emulator.camera.ov7620.light import blur
from cubestack.emulator.camera.ov7620.sensor import Ov7620
from cubestack.emulator.camera.ov7620.view import FisheyeCondition
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene
from cubestack.emulator.scene.file import SceneError

from .test_sensor import MANUAL, picture, write

EARTH = EarthSunScene(seed=4)
SUN = EarthSunScene.facing(sun_deg=(50.0, 20.0))
DARK = replace(EARTH, sun=(0, 0, 1))  # the Earth by night


def camera(
    *hazards: SensorHazard,
    scene: EarthSunScene = EARTH,
    which: CameraTarget = CameraTarget.NADIR,
    gain: int = 0,
    **condition: object,
) -> Ov7620:
    like = FisheyeCondition(hazards=hazards, **{"noise": False} | condition)  # type: ignore[arg-type]
    made = Ov7620(scene, which, like)
    write(made, MANUAL | {"EXPOSURE": 1 if which is CameraTarget.SUN else 4, "GAIN": gain})
    return made


def grey(*hazards: SensorHazard, frame: int = 3, **how: object) -> np.ndarray:
    return picture(camera(*hazards, **how), frame).astype(int)  # type: ignore[arg-type]


plain = cache(grey)


def centroid(image: np.ndarray) -> np.ndarray:
    y, x = np.nonzero(image > 150)
    return np.array([x.mean(), y.mean()])


def test_lens_is_unchanged_without_lens_hazards() -> None:
    assert camera().lens is NOMINAL
    assert camera(Gradient(), Defocus(sigma_px=3.0)).lens is NOMINAL


@pytest.mark.parametrize("name", sorted(HAZARDS.keys() - {"dose"}))
def test_worst_strength_is_visible_and_repeatable_in_the_ov7620(name: str) -> None:
    hazard = HAZARDS[name]
    worst = hazard.sample(hazard.strength.values[-1], None, np.random.default_rng(1))
    one = grey(worst)
    np.testing.assert_array_equal(one, grey(worst))
    assert np.mean(one != plain()) > 1e-3


def test_dose_effect_is_at_most_1_count_in_a_short_exposure() -> None:
    # 10 krad: 0.7 sources in each hundred pixels, of 4500 electrons a second; 433 a grey value.
    hazard = HAZARDS["dose"].sample(10, None, np.random.default_rng(1))
    assert np.abs(grey(hazard) - grey()).max() <= 1


@pytest.mark.parametrize("gain", [0, 0x1F])
def test_gradient_maximum_does_not_depend_on_the_gain(gain: int) -> None:
    added = grey(Gradient(counts=60.0, seed=1), scene=DARK, gain=gain) - 34
    assert added.min() <= 1
    assert added.max() == pytest.approx(60, abs=1)


def test_background_adds_its_mean_and_noise_in_the_ov7620() -> None:
    added = grey(Background(counts=20.0, sigma=4.0), scene=DARK, noise=True) - 34
    assert added.mean() == pytest.approx(20, abs=0.1)
    assert added.std() == pytest.approx(np.hypot(4, 0.8), rel=0.03)


def test_proton_tracks_differ_between_frames_and_cameras() -> None:
    hit = Protons(hits=100)
    shots = [grey(hit, scene=DARK, frame=frame, which=w) for frame in (3, 4) for w in CameraTarget]
    places = [set(np.flatnonzero(shot > 40).tolist()) for shot in shots]
    assert min(map(len, places)) > 50
    for n, one in enumerate(places):
        for other in places[:n]:
            assert len(one & other) < 0.2 * len(one)


def test_hot_pixel_hazard_adds_to_the_condition_key() -> None:
    stuck = grey(HotPixels(count=50), scene=DARK, hot_pixels=9)
    np.testing.assert_array_equal(stuck, grey(scene=DARK, hot_pixels=59))
    with pytest.raises(SceneError, match="hot_pixels and hot_pairs must be at most 76800 together"):
        FisheyeCondition(hazards=(HotPixels(count=75_000),), hot_pairs=1801)


def test_hazards_are_drawn_independently_per_camera() -> None:
    slopes = [grey(Gradient(seed=6), scene=DARK, which=which) for which in CameraTarget]
    assert np.abs(slopes[0] - slopes[1]).max() > 5
    sun, nadir = (camera(LensResiduals(seed=6), which=which).lens for which in CameraTarget)
    assert sun.residuals != nadir.residuals


def test_a_longer_lens_moves_the_sun_away_from_the_boresight() -> None:
    boresight = np.array([369, 250])
    own, moved = (
        centroid(grey(*hazards, scene=SUN, which=CameraTarget.SUN)) - boresight
        for hazards in ((), (FocalLength(percent=3.0),))
    )
    assert np.hypot(*own) > 120
    np.testing.assert_allclose(moved, 1.03 * own, atol=0.1)


def test_longer_focal_length_enlarges_the_lit_field() -> None:
    lens = camera(FocalLength(percent=3.0)).lens
    lit = [np.count_nonzero(lens_of(CameraTarget.NADIR, own).field.lit) for own in (NOMINAL, lens)]
    # All but what is cut off at the top and bottom edge.
    assert 1.02 < lit[1] / lit[0] < 1.03**2


def test_residuals_displace_and_can_be_undone() -> None:
    residual = LensResiduals(rms_px=1.0, seed=2)
    crooked = lens_of(CameraTarget.SUN, camera(residual, which=CameraTarget.SUN).lens)
    straight = lens_of(CameraTarget.SUN)
    y, x = np.mgrid[110:390:30, 230:510:30]
    pixels = np.stack([x.ravel(), y.ravel()], axis=1).astype(float)
    moved = np.array([crooked.project(v) for v in straight.unproject(pixels)]) - pixels
    assert 0.5 < np.sqrt((moved**2).sum(axis=1).mean()) < 1.5
    back = np.array([crooked.project(v) for v in crooked.unproject(pixels)])
    np.testing.assert_allclose(back, pixels, atol=1e-6)


@pytest.mark.parametrize("sigma", [0.5, 3.0])
def test_defocus_conserves_light(sigma: float) -> None:
    light = np.zeros((60, 80), np.float32)
    light[30, 40], light[31, 45] = 1000, 500
    soft = blur(light, sigma)
    assert soft.sum() == pytest.approx(1500, rel=1e-4)
    # Gaussian and pixel: 1/12 more variance.
    expected = gaussian_filter(light, np.hypot(sigma, 12**-0.5), truncate=5)
    np.testing.assert_allclose(soft, expected, atol=0.03 * expected.max())


def test_defocus_softens_the_limb() -> None:
    def steepest(image: np.ndarray) -> float:
        return float(np.abs(np.diff(image[236])).max())

    assert steepest(grey(Defocus(sigma_px=4.0))) < 0.5 * steepest(grey())
