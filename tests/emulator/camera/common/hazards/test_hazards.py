import inspect
import time
import timeit
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from cubestack.emulator.camera.common.hazards import HAZARDS, Background, Dose, Gradient, HotPixels
from cubestack.emulator.camera.common.hazards.contract import SensorHazard
from cubestack.emulator.camera.common.hazards.pixels import Response
from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.mlx75412 import lens as cubestar
from cubestack.emulator.camera.mlx75412.imager import Corrections, Mlx75412Imager
from cubestack.emulator.camera.mt9m001 import lens as aramis
from cubestack.emulator.camera.mt9m001.imager import Mt9m001Imager
from cubestack.emulator.camera.mt9m001.registers import read_settings
from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.sky import PictureScene, SkyScene
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS
from tests.emulator.scene.hazards.around import ORION, SHUTTER
from tests.together import together

DARK = replace(ORION, mag_limit=-5.0)
CAMERAS = ("cubestar", "aramis")


def picture(
    camera: str,
    *hazards: SensorHazard,
    scene: SkyScene | PictureScene = ORION,
    readout_ps: int = 10**12,
    **condition: object,
) -> np.ndarray:
    shutter = replace(SHUTTER, readout_ps=readout_ps)
    if camera == "cubestar":
        like = replace(cubestar.CONDITION, hazards=hazards, **condition)  # type: ignore[arg-type]
        return Mlx75412Imager(1).render(scene, like, shutter, Corrections())
    like = replace(aramis.CONDITION, hazards=hazards, **condition)  # type: ignore[arg-type]
    return Mt9m001Imager(1).render(scene, like, shutter, read_settings(RegisterFile(REGISTERS)))


plain = cache(picture)


@pytest.mark.parametrize("hazard", HAZARDS.values(), ids=list(HAZARDS))
def test_each_hazard_describes_itself_and_its_keys(hazard: type[SensorHazard]) -> None:
    assert HAZARDS[hazard.name] is hazard
    assert hazard.meaning
    assert 5 <= len(hazard.strength.values) <= 7
    assert hazard.strength.key in hazard.declared()
    assert inspect.getdoc(hazard)


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("hazard", HAZARDS.values(), ids=list(HAZARDS))
def test_worst_strength_is_visible_and_repeatable(hazard: type[SensorHazard], camera: str) -> None:
    worst = hazard.sample(hazard.strength.values[-1], None, np.random.default_rng(1))
    first = picture(camera, worst)
    np.testing.assert_array_equal(first, picture(camera, worst))
    assert np.mean(first != plain(camera)) > 1e-4


@pytest.mark.slow
@together("camera", CAMERAS)
@together("name", sorted(HAZARDS.keys() - {"defocus", "response"}))
def test_least_strength_has_no_effect(name: str, camera: str) -> None:
    hazard = HAZARDS[name]
    least = hazard.sample(hazard.strength.values[0], None, np.random.default_rng(1))
    np.testing.assert_array_equal(picture(camera, least), plain(camera))


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("counts", [10.0, 60.0])
def test_gradient_spans_0_to_its_counts_in_every_camera(camera: str, counts: float) -> None:
    one = picture(camera, Gradient(counts=counts, seed=2), scene=DARK, noise=False).astype(int)
    added = one - picture(camera, scene=DARK, noise=False)
    assert added.min() <= 1
    assert added.max() == pytest.approx(counts, abs=1)
    assert np.median(added) == pytest.approx(counts / 2, abs=1)
    across = Gradient(counts=counts, seed=3)
    assert np.any(picture(camera, across, scene=DARK, noise=False) != one)


@pytest.mark.parametrize("camera", CAMERAS)
def test_background_adds_its_mean_and_noise_in_every_camera(camera: str) -> None:
    counts = picture(camera, Background(counts=20.0, sigma=4.0), scene=DARK, hot_pixels=0)
    added = counts.astype(float) - picture(camera, scene=DARK, hot_pixels=0, noise=False)
    assert added.mean() == pytest.approx(20, abs=1)
    assert added.std() == pytest.approx(4, abs=0.3)


@pytest.mark.parametrize("camera", CAMERAS)
def test_hot_pixel_hazard_equals_the_key_and_is_stable_over_time(camera: str) -> None:
    as_key = picture(camera, scene=DARK, hot_pixels=520)
    as_hazard = picture(camera, HotPixels(count=500), scene=DARK, hot_pixels=20)
    np.testing.assert_array_equal(as_key, as_hazard)
    later = picture(camera, HotPixels(count=500), scene=DARK, readout_ps=3 * 10**12)
    assert np.sum((as_hazard > 30) & (later > 30)) > 0.8 * np.sum(as_hazard > 30) > 40


def test_rejects_more_hot_pixels_than_pixels() -> None:
    with pytest.raises(SceneError, match="hot_pixels must be at most 524288, not 524289"):
        replace(cubestar.CONDITION, hazards=(HotPixels(count=289),), hot_pixels=524_000)


@pytest.mark.parametrize("camera", CAMERAS)
def test_protons_differ_per_frame_and_damage_stays(camera: str) -> None:
    def bright(name: str, readout_ps: int) -> set[int]:
        hazard = HAZARDS[name].sample(HAZARDS[name].strength.usual, None, np.random.default_rng(1))
        frame = picture(camera, hazard, scene=DARK, readout_ps=readout_ps, hot_pixels=0)
        return set(np.flatnonzero(frame > 30).tolist())

    protons, again = bright("protons", 10**12), bright("protons", 2 * 10**12)
    assert min(len(protons), len(again)) > 50
    assert len(protons & again) < 0.2 * len(protons)
    damage, later = bright("dose", 10**12), bright("dose", 2 * 10**12)
    assert len(damage & later) > 0.8 * len(damage) > 100


def test_sensor_hazards_apply_to_an_image_scene_and_lens_hazards_do_not(
    striped: PictureScene,
) -> None:
    own = picture("cubestar", scene=striped)
    np.testing.assert_array_equal(own, striped.pixels)
    veiled = picture("cubestar", Background(counts=20.0, sigma=0.0), scene=striped)
    np.testing.assert_array_equal(veiled, own + 20)
    noisy = picture("cubestar", Background(counts=20.0, sigma=4.0), scene=striped)
    assert (noisy.astype(int) - own).std() == pytest.approx(4, rel=0.02)
    focal = HAZARDS["focal-length"](percent=3.0)  # type: ignore[call-arg]
    np.testing.assert_array_equal(picture("cubestar", focal, scene=striped), own)


@pytest.mark.parametrize("name", ["protons", "hot-pixels"])
def test_hazard_adds_little_render_time(name: str) -> None:
    hazard = HAZARDS[name].sample(HAZARDS[name].strength.usual, None, np.random.default_rng(1))

    def seconds(*hazards: SensorHazard) -> float:
        render = partial(picture, "cubestar", *hazards, scene=DARK)
        return min(timeit.repeat(render, timer=time.process_time, repeat=3, number=1))

    assert seconds(hazard) - seconds() < 0.1  # measured: below 10 ms


def test_dark_correction_removes_the_mean_dark_current_of_dose() -> None:
    # 10 krad: four times 1008 counts of 12 bits per second, at 65 C in 0.3856 s.
    like = replace(cubestar.CONDITION, hazards=(Dose(krad=10.0),), temperature_c=65.0)
    imager = Mlx75412Imager(1)
    raw, corrected = (
        imager.render(DARK, like, SHUTTER, Corrections(dark=dark)) for dark in (False, True)
    )
    assert np.median(raw) == pytest.approx(4 * 1008 * 0.3856 / 16, abs=4)
    assert np.median(corrected) < 5


def test_mean_dark_current_of_dose_leaves_its_noise() -> None:
    # Away from the sources: four times the dark current is twice its noise.
    def sigma(krad: float) -> float:
        frame = picture("aramis", Dose(krad=krad), Background(sigma=0.0), temperature_c=100.0)
        away = frame.astype(float) - np.median(frame)
        return float(away[np.abs(away) <= 7].std())

    assert sigma(10.0) == pytest.approx(2 * sigma(0.0), rel=0.1)


SHAPE = (512, 1024)


def gain(hazard: Response) -> np.ndarray:
    return hazard.response(SHAPE)


def test_pixel_response_has_the_declared_spread() -> None:
    field = gain(Response(percent=2.0, columns_percent=0.5, dust=0))
    assert field.mean() == pytest.approx(1, abs=1e-3)
    columns = field.mean(axis=0)
    assert columns.std() == pytest.approx(np.hypot(0.005, 0.02 / np.sqrt(512)), rel=0.1)
    assert (field - columns).std() == pytest.approx(0.02, rel=0.02)


def test_dust_shadows_have_the_declared_depth() -> None:
    # Grains only shade pixels; the drop is the mean over a grain's area.
    clean, dusty = (gain(Response(percent=4.0, dust=n, seed=3)) for n in (0, 40))
    shade = dusty / clean
    assert shade.max() == pytest.approx(1)
    assert 0.8 <= shade.min() < 0.85  # five times 4 %, the deepest of forty
    assert 0.001 < np.mean(shade < 0.98) < 0.05


def test_response_repeats_by_seed_and_is_never_negative() -> None:
    np.testing.assert_array_equal(gain(Response(seed=1)), gain(Response(seed=1)))
    assert np.any(gain(Response(seed=1)) != gain(Response(seed=2)))
    assert gain(Response(percent=30.0)).min() >= 0
