from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.camera.ov7620.fisheye import LENSES
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.clients.cubesense.client import direction
from cubestack.host.experiments.cubesense.pictures import (
    _inset,
    annotate_nadir,
    annotate_sun,
    pixel,
)
from cubestack.host.experiments.measure import measure


@pytest.mark.parametrize("camera", Camera)
def test_pixel_matches_the_lens_of_the_camera(camera: Camera) -> None:
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


@pytest.mark.parametrize("camera", Camera)
def test_brightness_is_drawn_linearly(tmp_path: Path, camera: Camera) -> None:
    picture = np.zeros((480, 640), np.uint8)
    picture[300:340, 200:240], picture[300:340, 300:340] = 100, 200
    if camera is Camera.NADIR:
        annotate_nadir(picture, np.zeros((0, 2)), None, tmp_path / "drawn.png")
    else:
        annotate_sun(picture, (0x3FF, 0x1FF), None, tmp_path / "drawn.png")
    drawn = np.asarray(Image.open(tmp_path / "drawn.png"))[600:680]
    levels = [np.median(drawn[:, 2 * left : 2 * left + 80]) for left in (100, 200, 300)]
    assert levels == pytest.approx([0, 127.5, 255], abs=1)


@pytest.mark.parametrize(
    ("sensor", "told", "other"), [("sun", "sun_pixels", "edges"), ("nadir", "edges", "sun_pixels")]
)
def test_each_sensor_has_its_own_column(sensor: str, told: str, other: str) -> None:
    (result,) = measure("cubesense", frames=1, sensor=sensor)
    assert result.sensor == sensor
    assert getattr(result, told) > 0
    assert getattr(result, other) is None
