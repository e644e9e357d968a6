"""`EmulatedDevice.point` against SciPy's rotations, and its recording."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.recording.replay import Replay
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.emulator.scene.orbit_file import load_orbit
from cubestack.emulator.scene.pointing import KEPT_S, Pointing, Pose, turn
from cubestack.emulator.scene.sky import PictureScene, SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.emulation.controls import EmulatedControls
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from cubestack.host.emulation.orbit import follow
from cubestack.host.emulation.records import start_recorder
from cubestack.host.recording.setups import emulated_setup

ORBIT = Path(__file__).parents[3] / "examples" / "orbits" / "sun-synchronous.toml"
START = Rotation.from_euler("zyx", [0.4, -1.1, 0.2])
RATE = np.array([0.05, -0.1, 0.2])  # deg/s

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


def turned(start: Rotation, rate_deg_s: Any, seconds: float) -> Rotation:
    """Inertial to camera after a constant body rate: the sky turns the other way."""
    return Rotation.from_rotvec(-np.radians(rate_deg_s) * seconds) * start


def apart_deg(quaternion: Any, expected: Rotation) -> float:
    return math.degrees((Rotation.from_quat(quaternion) * expected.inv()).magnitude())


def truth(device: AnyEmulated, time_s: float) -> Any:
    return device.scene.truth(round(time_s * PS_PER_S))


def shoot(tracker: Any) -> Any:
    """A star tracker's attitude, and the time of its picture."""
    if tracker.device.name == "aramis":
        tracker.client.activate()
        found = tracker.client.measure()
        return found, found.image_uptime_s
    tracker.client.capture_and_process()
    found = tracker.client.attitude()
    return found, found.image_time_s


@pytest.mark.parametrize("name", ["cubestar", "aramis"])
def test_star_tracker_measures_where_it_is_pointed(name: str) -> None:
    with open_device(name, SkyScene((0, 0, 0, 1)), profile="extended") as tracker:
        for at_s in (30.0, 60.0):
            tracker.wait(at_s - tracker.time_s)
            start = START * Rotation.from_rotvec([0, 0, at_s / 100])
            tracker.point(start.as_quat(), RATE)
            assert apart_deg(truth(tracker, at_s), start) < 1e-9
            found, image_s = shoot(tracker)
            assert found.valid
            assert image_s > at_s
            expected = turned(start, RATE, image_s - at_s)
            error_deg = (Rotation.from_quat(found.quaternion) * expected.inv()).as_rotvec(
                degrees=True
            )
            claimed_deg = np.degrees(tracker.client.quality().sigmas_rad)
            assert np.all(np.abs(error_deg) < 4 * claimed_deg)
            assert np.max(np.abs(error_deg)) < 0.02


def test_sun_and_earth_sensor_measures_where_it_is_pointed() -> None:
    with open_device("cubesense", profile="extended") as sense:
        nadir, sun = np.array([0.2, 0.1, 1.0]), np.array([0.3, 0.4, -1.0])
        attitude = START
        for step in range(2):
            sense.wait(20.0)
            attitude = attitude * Rotation.from_rotvec([0.1 * step, 0, 0])
            inertial = {"nadir": attitude.apply(nadir, inverse=True)} if not step else {}
            if not step:
                inertial["sun"] = attitude.apply(sun, inverse=True)
                known = dict(inertial)
            sense.point(attitude.as_quat(), RATE, **inertial)
            for camera, mounting in ((Camera.SUN, "sun"), (Camera.NADIR, "nadir")):
                began_s = sense.time_s
                found = sense.client.capture_and_detect(camera)
                assert found.detected
                now = turned(attitude, RATE, began_s - 20.0 * (step + 1))
                own = getattr(sense.scene, f"{mounting}_camera").matrix
                expected = own @ now.apply(known[mounting] / np.linalg.norm(known[mounting]))
                assert math.degrees(math.acos(min(1, found.vector @ expected))) < 0.3


def test_earlier_images_keep_their_truth() -> None:
    with open_device("cubestar", SkyScene(START.as_quat()), profile="extended") as tracker:
        tracker.wait(1.0)
        tracker.point(START.as_quat(), RATE)
        tracker.client.capture_and_process()
        before = tracker.board.truths()["attitude"]
        tracker.point((0, 0, 0, 1))
        assert tracker.board.truths()["attitude"] == pytest.approx(before, abs=1e-15)


def test_only_poses_that_an_image_needs_are_kept() -> None:
    poses: tuple[Pose, ...] = ()
    for step in range(1000):
        poses = turn(poses, Pose((0, 0, 0, 1), at_s=step / 10))
        assert poses[-1].at_s == step / 10
    assert poses[0].at_s < 99.9 - KEPT_S <= poses[1].at_s
    assert len(turn(poses, Pose((1, 0, 0, 0), at_s=99.9))) == len(poses)


def test_bodies_disturb_a_star_tracker_while_they_are_near() -> None:
    with open_device("cubestar") as tracker:
        for moon, names in (((0, 0, 1), ["moon"]), ((0, 0, -1), [])):
            tracker.point((0, 0, 0, 1), moon=moon, sun=(0, 0, -1))
            assert [one.name for one in tracker.scene.hazards] == names
        tracker.point((0, 0, 0, 1), nadir=(0, 0, 1), altitude_km=500.0)
        (limb,) = tracker.scene.hazards
        assert (limb.name, limb.altitude_km) == ("earth-limb", 500.0)
        tracker.point((0, 0, 0, 1))
        assert tracker.scene.hazards == (limb,)


def test_recording_replays_the_motion(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    with path.open("w") as stream, open_device("cubestar", seed=3) as tracker:
        recorder = start_recorder(tracker, stream, emulated_setup(3, None))
        for step in range(2):
            tracker.wait(1.0)
            tracker.point(START.as_quat(), RATE * step, moon=(1, 0, 0))
            tracker.client.capture_and_process()
            tracker.client.attitude()
        recorder.close()
    recording = load_recording(path)
    assert len(recording.controls) == 2
    assert not differences(recording)
    wrong = [Pointing.parse(one.words[1:]) for one in recording.controls]
    assert np.array_equal(wrong[1].quaternion, START.as_quat())
    still = type(recording)(
        recording.name,
        recording.device,
        recording.bauds,
        tuple(one for one in recording.events if one not in recording.controls),
        recording.setup,
    )
    assert differences(still)


def differences(recording: Any) -> list[str]:
    with open_device("cubestar", seed=3) as again:
        board, act = again.board, EmulatedControls(again).act
        return Replay(recording, board.kernel, board.uarts, board.i2c_bus, act).run(
            again.device.interface
        )


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ([], "point needs quaternion=X,Y,Z,W"),
        (["quaternion=0,0,1"], "point: quaternion must be a list of 4 numbers, not '0,0,1'"),
        (["quaternion=0,0,0,0"], "a quaternion needs a finite length above 0, not 0.0"),
        (["quaternion=0,0,0,1", "mars=1,0,0"], "point: no value 'mars'; known: quaternion, "),
        (["quaternion=0,0,0,1", "sun=0,0,0"], "sun must be 3 numbers, not all 0"),
        (["quaternion=0,0,0,1", "rate_deg_s=0,0,101"], "rate_deg_s must be -100 to 100, not"),
    ],
)
def test_wrong_words_are_rejected(words: list[str], error: str) -> None:
    with pytest.raises(ValueError, match=r"^[^\n]*$") as raised, open_device("cubestar") as tracker:
        EmulatedControls(tracker).point(words)
    assert error in str(raised.value)


def test_picture_cannot_be_pointed(tmp_path: Path) -> None:
    from PIL import Image

    Image.new("L", (1024, 512)).save(tmp_path / "sky.png")
    picture = PictureScene(tmp_path / "sky.png")
    error = "cubestar cannot be pointed: its PictureScene has no pointed"
    with open_device("cubestar", picture) as tracker, pytest.raises(ValueError, match=error):
        tracker.point((0, 0, 0, 1))


def test_device_on_an_orbit_cannot_be_pointed() -> None:
    with open_device("cubesense") as sense:
        orbit = load_orbit(ORBIT)
        orbit.mountings.clear()
        follow(orbit, [sense])
        with pytest.raises(ValueError, match="cubesense cannot be pointed: an orbit moves"):
            sense.point((0, 0, 0, 1))


def test_form_shows_the_scene_in_body_axes() -> None:
    with open_device("cubesense") as sense:
        sense.wait(3.0)
        sense.point(START.as_quat(), RATE, nadir=START.apply([0, 0, 1], inverse=True))
        now = sense.board.kernel.now
        shown = sense.scene.in_body_axes()
        for camera in CameraTarget:
            before, after = sense.scene.truth(camera, now), shown.truth(camera, now)
            assert after.vector == pytest.approx(before.vector, abs=1e-12)
        assert not shown.poses
