from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.host.calibration.camera import Camera
from cubestack.host.emulation.emulated import open_device
from cubestack.host.experiments.cubesense.pictures import overlay
from cubestack.host.experiments.scene_truth import true_stars
from cubestack.host.pictures.images import IDENTIFIED, SKY, UNKNOWN, TrueStar, star_sheet, stretched
from cubestack.host.pictures.overlay import star_overlay
from cubestack.host.pictures.sheet import GRID, TRUTH

SHAPE = (256, 512)
CAMERA = Camera(f_px=600, cx_px=255.5, cy_px=127.5)


@dataclass(frozen=True)
class Found:
    x_px: float
    y_px: float
    hipparcos: int | None


def marked(sheet: object, colour: tuple[int, int, int]) -> NDArray[np.bool_]:
    return np.all(np.asarray(sheet)[: SHAPE[0]] == colour, axis=2)


def test_found_identified_and_true_stars_have_different_marks() -> None:
    picture = np.zeros(SHAPE, np.uint8)
    stars = [Found(100, 80, 32349), Found(300, 200, None)]
    sheet = star_sheet(picture, stars, "sky", (), CAMERA.directions, [TrueStar(1, 400, 50)])
    for colour, (x, y) in ((IDENTIFIED, (100, 80)), (UNKNOWN, (300, 200)), (TRUTH, (400, 50))):
        rows, columns = np.nonzero(marked(sheet, colour)[y - 20 : y + 20, x - 20 : x + 20])
        assert np.hypot(columns.mean() - 20, rows.mean() - 20) < 2
    assert marked(sheet, GRID).sum() > 200
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
def test_overlay_has_nadir_edges_and_limb(profile: str, limbs: int) -> None:
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
