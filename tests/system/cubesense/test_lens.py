import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.lens_error import NOMINAL, LensError, draw_lens
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene
from cubestack.firmware_model.interface.cubesense.codes import Camera
from tests.system.conftest import Measure, Open

OUTWARDS = ((30.0, 0.0), (60.0, 1.0))


def test_lens_error_shifts_the_measured_sun(ready: Open) -> None:
    condition = FisheyeCondition(noise=False, sun_lens=LensError(radial_deg=OUTWARDS))
    with ready(None, profile="extended") as opened:
        for theta, expected in OUTWARDS:
            for turn in np.radians([20, 140, 260]):
                sun = (theta * np.cos(turn), theta * np.sin(turn))
                scene = EarthSunScene.facing(sun_deg=sun, nadir=(1, 0, 0))
                opened.scene = EarthSunView(scene, condition)
                found = opened.client.capture_and_detect(Camera.SUN)
                error = np.hypot(found.alpha_deg, found.beta_deg) - theta
                assert error == pytest.approx(expected, abs=0.1)


def test_axis_offset_shifts_the_measured_earth(ready: Open) -> None:
    """By 1 px, which at the limb, 63.5 deg away, is 0.45 deg, on the axis 0.34."""
    measured = []
    for lens in (NOMINAL, LensError((1.0, 0.0))):
        condition = FisheyeCondition(noise=False, nadir_lens=lens)
        view = EarthSunView(EarthSunScene.facing(nadir_deg=(3.0, -2.0)), condition)
        with ready(view, profile="extended") as opened:
            measured.append(opened.client.capture_and_detect(Camera.NADIR))
    one, other = measured
    assert 0.34 < other.alpha_deg - one.alpha_deg < 0.5
    assert other.beta_deg == pytest.approx(one.beta_deg, abs=0.03)


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_seed_determines_the_lenses_of_a_unit(ready: Open, profile: str) -> None:
    with ready(None, profile=profile, set="", seed=5) as opened:
        for camera, target in zip(Camera, CameraTarget, strict=True):
            drawn = draw_lens(target, 5)
            assert opened.board.cameras[camera].lens == (
                drawn if profile == "published" else NOMINAL
            )
    with ready(None, profile=profile, set="lens=nominal") as opened:
        assert opened.board.cameras[Camera.SUN].lens == NOMINAL


@pytest.mark.slow
def test_errors_of_published_lenses(measure: Measure) -> None:
    """Figures 7.1 and 7.3: the order of 0.14 deg at nadir; the Sun is found too far out."""
    errors = [
        frame[f"{axis}_deg"] - frame[f"truth_{axis}_deg"]
        for seed in (0, 1)
        for frame in measure(
            "--sensor", "nadir", "--frames", 6, "--seed", seed, "--profile", "published"
        )
        for axis in ("alpha", "beta")
    ]
    assert 0.06 < np.mean(np.abs(errors)) < 0.3
    sun = measure("--sensor", "sun", "--frames", 16, "--seed", 1, "--profile", "published")
    true = np.array([np.hypot(f["truth_alpha_deg"], f["truth_beta_deg"]) for f in sun])
    outwards = np.array([np.hypot(f["alpha_deg"], f["beta_deg"]) for f in sun]) - true
    beyond = outwards[(true > 60) & (true < 80)]
    assert len(beyond) > 3
    assert 0.3 < beyond.min() < beyond.max() < 2
    assert np.abs(outwards[true < 40]).mean() < 0.3
