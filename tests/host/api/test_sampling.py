"""Samplers against the truth at the time of their images."""

import math
from typing import Any

import numpy as np
import pytest

import cubestack
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.attitude import attitude_error_deg, propagate, random_quaternion
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.sampling import AttitudeSampler, DirectionSampler, Sample

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

STEP_S = 3.0
START = random_quaternion(np.random.default_rng(5))


def run(sampler: Any, rate: Any, until_s: float, begin_s: float = 0.0) -> dict[float, Any]:
    """Samples by the time of the step that returned them."""
    found = {}
    for time_s in np.arange(begin_s, until_s + STEP_S / 2, STEP_S).tolist():
        found[time_s] = sampler.step(time_s, propagate(START, rate, time_s), rate)
    return found


@pytest.mark.parametrize("name", ["cubestar", "aramis"])
def test_attitude_has_the_time_of_its_image(name: str) -> None:
    rate = (0.4, 0.3, 0.0)  # 0.01 deg in 20 ms
    with cubestack.open_device(name, SkyScene(START, rate), profile="extended") as device:
        if name == "aramis":
            device.client.activate()
        samples = run(AttitudeSampler(device), rate, 12.0, begin_s=6.0)
    assert samples.pop(6.0) is None
    for time_s, sample in samples.items():
        assert time_s - STEP_S - 0.1 < sample.time_s < time_s
        truth = propagate(START, rate, sample.time_s)
        assert attitude_error_deg(sample.value, truth)[0] < 0.01


def test_directions_have_the_time_of_their_image() -> None:
    rate = (0.0, 0.0, 2.0)
    with cubestack.open_device("cubesense", profile="extended") as device:
        samplers = DirectionSampler(device, "sun"), DirectionSampler(device, "nadir")
        bodies = {"sun": (0.3, 0.4, -1.0), "nadir": (0.2, 0.1, 1.0)}
        for time_s in (STEP_S, 2 * STEP_S):
            now = propagate((0, 0, 0, 1), rate, time_s)
            samples = [one.step(time_s, now, rate, **bodies) for one in samplers]
            if time_s == STEP_S:
                device.wait(STEP_S / 2)
                shutters = [device.board.stored_frame(camera) for camera in Camera]
        scene = device.scene
    for sample, shutter, target in zip(samples, shutters, CameraTarget, strict=True):
        assert sample.time_s == pytest.approx(shutter.mid_exposure_ps(240) / PS_PER_S, abs=2e-3)
        at_ps = round(sample.time_s * PS_PER_S)
        mounting = scene.sun_camera if target is CameraTarget.SUN else scene.nadir_camera
        expected = mounting.matrix.T @ scene.truth(target, at_ps).vector
        assert math.degrees(math.acos(min(1.0, sample.value @ expected))) < 0.3


def missing(samples: dict[float, Any]) -> dict[float, float]:
    """Times of missing fixes, by the step that returned them."""
    return {
        time_s: sample.time_s
        for time_s, sample in samples.items()
        if isinstance(sample, Sample) and sample.value is None
    }


@pytest.mark.parametrize(
    ("fault", "lost"),
    [
        ("latch-up imager at_s=6.2", {9.0: 6.0}),
        ("camera-dead imager at_s=5 for_s=2", {9.0: 6.0}),
        ("uart-drop uart at_s=5.5 for_s=5", {6.0: 3.0, 12.0: 10.0}),
        ("processor-reset reset-pin at_s=6.2", {9.0: 6.0}),
    ],
)
def test_missing_attitude_has_the_time_of_its_request(fault: str, lost: dict[float, float]) -> None:
    with cubestack.open_device("cubestar", SkyScene(START), profile="extended") as device:
        device.faults.inject_words(fault.split())
        samples = run(AttitudeSampler(device), (0.1, 0.0, 0.0), 18.0)
    found = missing(samples)
    assert found.keys() == lost.keys()
    assert list(found.values()) == pytest.approx(list(lost.values()), abs=0.1)
    for time_s in (15.0, 18.0):
        sample = samples[time_s]
        truth = propagate(START, (0.1, 0.0, 0.0), sample.time_s)
        assert attitude_error_deg(sample.value, truth)[0] < 0.01


def test_memory_is_switched_on_again_after_a_latch_up() -> None:
    with cubestack.open_device("cubesense", profile="extended") as device:
        device.faults.inject_words(["latch-up", "SRAM1", "at_s=4"])
        sampler = DirectionSampler(device, "sun")
        found = {t: sampler.step(t, (0, 0, 0, 1), (0, 0, 0)) for t in (0.0, 3.0, 6.0, 9.0, 12.0)}
    assert missing(found).keys() == {9.0}
    assert found[12.0].value == pytest.approx(found[3.0].value)


def test_simulation_cannot_go_back() -> None:
    with cubestack.open_device("cubestar") as device:
        sampler = AttitudeSampler(device)
        sampler.step(2.0, START, (0, 0, 0))
        with pytest.raises(ValueError, match="cubestar cannot go back to 1 s; open it again"):
            sampler.step(1.0, START, (0, 0, 0))
