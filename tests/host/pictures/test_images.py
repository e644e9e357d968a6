from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.camera.ov7620.fisheye import LENSES
from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.host.calibration.camera import Camera
from cubestack.host.clients.cubesense.client import direction
from cubestack.host.emulation.emulated import open_device
from cubestack.host.experiments.cubesense.pictures import (
    _inset,
    annotate_nadir,
    annotate_sun,
    overlay,
    pixel,
)
from cubestack.host.experiments.measure import measure
from cubestack.host.experiments.scene_truth import true_stars
from cubestack.host.pictures.images import IDENTIFIED, SKY, UNKNOWN, TrueStar, star_sheet, stretched
from cubestack.host.pictures.overlay import star_overlay
from cubestack.host.pictures.sheet import GRID, TRUTH

from .conftest import drawn, opened

SHAPE = (256, 512)
CAMERA = Camera(f_px=600, cx_px=255.5, cy_px=127.5)


@dataclass(frozen=True)
class Found:
    x_px: float
    y_px: float
    hipparcos: int | None


def test_found_identified_and_true_stars_have_different_marks() -> None:
    picture = np.zeros(SHAPE, np.uint8)
    stars = [Found(100, 80, 32349), Found(300, 200, None)]
    sheet = star_sheet(picture, stars, "sky", (), CAMERA.directions, [TrueStar(1, 400, 50)])
    for colour, (x, y) in ((IDENTIFIED, (100, 80)), (UNKNOWN, (300, 200)), (TRUTH, (400, 50))):
        away = drawn(sheet, colour, SHAPE[0]) - (x, y)
        near = away[np.abs(away).max(axis=1) < 20]
        assert np.hypot(*near.mean(axis=0)) < 2
    assert len(drawn(sheet, GRID, SHAPE[0])) > 200
    assert sheet.size[1] > SHAPE[0]


def test_stretch_ignores_a_hot_pixel_and_blackens_half_the_sky() -> None:
    rng = np.random.default_rng(4)
    picture = rng.integers(2, 6, (512, 1024)).astype(np.uint8)
    picture[10:30, 10:30] = 60
    without = stretched(picture, SKY)
    picture[100, 100] = 255
    assert np.array_equal(np.delete(stretched(picture, SKY), 100, 0), np.delete(without, 100, 0))
    assert (without == 0).mean() >= 0.5
    assert without.max() == 255


def test_true_stars_are_placed_by_their_directions() -> None:
    places = true_stars(quaternion_from_pointing(84, -1, 20), CAMERA.directions, SHAPE)
    belt = {star.hipparcos: star for star in places}
    assert {26727, 26311, 25930} <= set(belt)  # Alnitak, Alnilam, Mintaka
    distance_px = np.hypot(belt[26727].x_px - belt[25930].x_px, belt[26727].y_px - belt[25930].y_px)
    assert distance_px == pytest.approx(600 * np.radians(2.736), rel=0.02)
    assert all(0 <= s.x_px <= SHAPE[1] - 1 and 0 <= s.y_px <= SHAPE[0] - 1 for s in places)


@pytest.mark.parametrize(("profile", "limbs"), [("published", 0), ("extended", 1)])
def test_overlay_shows_nadir_edges_and_limb(profile: str, limbs: int) -> None:
    with open_device("cubesense", profile=profile) as emulated:
        emulated.client.client.command("CaptureAndDetect", Camera="NADIR", Sram="SRAM2")
        emulated.client.client.wait_processed(10)
        found = overlay(emulated.client, "memory nadir")
        assert not overlay(emulated.client, "memory sun").marks
    edges = np.array([(one.x_px, one.y_px) for one in found.marks if one.name == "edge"])
    (centre,) = (one for one in found.marks if one.name == "nadir")
    assert len(edges) > 10
    assert len(found.lines) == limbs
    for line in found.lines:
        apart = np.linalg.norm(edges[:, None] - line, axis=2).min(axis=1)
        assert np.median(apart) < 4  # points of the limb are some pixels apart
        assert np.linalg.norm(line.mean(axis=0) - (centre.x_px, centre.y_px)) < 30


def test_overlay_names_identified_stars() -> None:
    with open_device("cubestar") as emulated:
        emulated.client.client.command("CaptureAndProcess")
        emulated.client.client.wait_processed(10)
        marks = star_overlay(emulated.client, "SRAM").marks
    assert {one.name: one.hipparcos for one in marks}["Rigel"] == 24436
    assert all((one.hipparcos is None) == (one.name == "") for one in marks)


@pytest.mark.parametrize("camera", codes.Camera)
def test_pixel_matches_the_lens_of_the_camera(camera: codes.Camera) -> None:
    rng = np.random.default_rng(3)
    angles = rng.uniform(-60, 60, (50, 2))
    vectors = np.array([direction(*pair) for pair in angles])
    seen = np.array([LENSES[CameraTarget[camera.name]].project(vector) for vector in vectors])
    np.testing.assert_allclose(pixel(camera, vectors), seen, atol=0.01)


@pytest.mark.parametrize("at", [(100, 100), (500, 100), (100, 400), (500, 400)])
def test_enlarged_window_reports_its_whole_box(at: tuple[int, int]) -> None:
    image = Image.new("RGB", (1280, 960))
    box = _inset(image, np.full((480, 640), 255, np.uint8), at, np.array(at, float), None)
    assert (box.left, box.top, box.right, box.bottom) == image.getbbox()


@pytest.mark.parametrize("camera", codes.Camera)
def test_brightness_is_drawn_linearly(tmp_path: Path, camera: codes.Camera) -> None:
    picture = np.zeros((480, 640), np.uint8)
    picture[300:340, 200:240], picture[300:340, 300:340] = 100, 200
    if camera is codes.Camera.NADIR:
        annotate_nadir(picture, np.zeros((0, 2)), None, tmp_path / "drawn.png")
    else:
        annotate_sun(picture, (0x3FF, 0x1FF), None, tmp_path / "drawn.png")
    rows = opened(tmp_path / "drawn.png")[600:680]
    levels = [np.median(rows[:, 2 * left : 2 * left + 80]) for left in (100, 200, 300)]
    assert levels == pytest.approx([0, 127.5, 255], abs=1)


@pytest.mark.parametrize(
    ("sensor", "told", "other"), [("sun", "sun_pixels", "edges"), ("nadir", "edges", "sun_pixels")]
)
def test_each_sensor_has_its_own_column(sensor: str, told: str, other: str) -> None:
    (result,) = measure("cubesense", frames=1, sensor=sensor)
    assert result.sensor == sensor
    assert getattr(result, told) > 0
    assert getattr(result, other) is None
