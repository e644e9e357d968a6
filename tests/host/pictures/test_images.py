from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.emulator.scene.attitude import quaternion_from_pointing
from cubestack.host.calibration.camera import Camera
from cubestack.host.experiments.scene_truth import true_stars
from cubestack.host.pictures.images import IDENTIFIED, SKY, UNKNOWN, TrueStar, star_sheet, stretched
from cubestack.host.pictures.sheet import GRID, TRUTH, Sheet

SHAPE = (256, 512)
CAMERA = Camera(f_px=600, cx_px=255.5, cy_px=127.5)


@dataclass(frozen=True)
class Found:
    x_px: float
    y_px: float
    hipparcos: int | None


def marked(sheet: object, colour: tuple[int, int, int]) -> NDArray[np.bool_]:
    return np.all(np.asarray(sheet)[: SHAPE[0]] == colour, axis=2)


def told_of(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> tuple[str, list[str]]:
    """The text below an image, and the texts of its legend."""
    seen: list[tuple[str, list[str]]] = []
    whole = Sheet.finished

    def finished(self, title, told, legend):  # type: ignore[no-untyped-def]
        seen.append((told, [entry.text for entry in legend]))
        return whole(self, title, told, legend)

    monkeypatch.setattr(Sheet, "finished", finished)
    star_sheet(*arguments)  # type: ignore[arg-type]
    return seen[0]


def test_found_identified_and_true_stars_have_different_marks() -> None:
    picture = np.zeros(SHAPE, np.uint8)
    stars = [Found(100, 80, 32349), Found(300, 200, None)]
    sheet = star_sheet(picture, stars, "sky", (), CAMERA.directions, [TrueStar(1, 400, 50)])
    for colour, (x, y) in ((IDENTIFIED, (100, 80)), (UNKNOWN, (300, 200)), (TRUTH, (400, 50))):
        rows, columns = np.nonzero(marked(sheet, colour)[y - 20 : y + 20, x - 20 : x + 20])
        assert np.hypot(columns.mean() - 20, rows.mean() - 20) < 2
    assert marked(sheet, GRID).sum() > 200
    assert sheet.size[1] > SHAPE[0]


def test_caption_counts_found_and_omitted_stars(monkeypatch: pytest.MonkeyPatch) -> None:
    stars = [Found(100, 80, 32349), Found(300, 200, None)]
    truth = [TrueStar(32349, 101, 80), TrueStar(1, 400, 50)]
    told, legend = told_of(
        monkeypatch, np.zeros(SHAPE, np.uint8), stars, "sky", ["7 spots too small"], None, truth
    )
    assert "2 stars found, 1 of them identified" in told
    assert "left out: 7 spots too small" in told
    assert "1 of the 2 bright stars in the field found" in told
    assert "found, not identified" in legend
    assert any("true place" in text for text in legend)


def test_caption_without_truth_and_lens(monkeypatch: pytest.MonkeyPatch) -> None:
    told, legend = told_of(monkeypatch, np.zeros(SHAPE, np.uint8), [Found(9, 9, 1)], "sky")
    assert told == "1 stars found, 1 of them identified"
    assert legend == ["identified by the device"]


def test_stretch_ignores_a_hot_pixel_and_blackens_half_the_sky() -> None:
    rng = np.random.default_rng(4)
    picture = rng.integers(2, 6, (512, 1024)).astype(np.uint8)
    picture[10:30, 10:30] = 60
    without = stretched(picture, SKY)
    picture[100, 100] = 255
    assert np.array_equal(np.delete(stretched(picture, SKY), 100, 0), np.delete(without, 100, 0))
    assert (without == 0).mean() >= 0.5
    assert without.max() == 255


def test_noise_is_not_stretched_to_full_scale() -> None:
    picture = np.random.default_rng(4).integers(10, 13, (64, 64)).astype(np.uint8)
    assert stretched(picture).max() < 80


def test_true_stars_are_placed_by_their_directions() -> None:
    places = true_stars(quaternion_from_pointing(84, -1, 20), CAMERA.directions, SHAPE)
    belt = {star.hipparcos: star for star in places}
    assert {26727, 26311, 25930} <= set(belt)  # Alnitak, Alnilam, Mintaka
    distance_px = np.hypot(belt[26727].x_px - belt[25930].x_px, belt[26727].y_px - belt[25930].y_px)
    assert distance_px == pytest.approx(600 * np.radians(2.736), rel=0.02)
    assert all(0 <= s.x_px <= SHAPE[1] - 1 and 0 <= s.y_px <= SHAPE[0] - 1 for s in places)
