from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.host.clients.cubesense.client import direction
from cubestack.host.experiments.cubesense.pictures import (
    EDGE,
    FITTED,
    annotate_nadir,
    annotate_sun,
    limb,
    pixel,
)
from cubestack.host.pictures.images import (
    ARROW,
    IDENTIFIED,
    UNKNOWN,
    TrueStar,
    annotate,
    png,
    save_picture,
    save_residuals,
    star_sheet,
    stretched,
    widest_deg,
)
from cubestack.host.pictures.overlay import _NAMES, star_name
from cubestack.host.pictures.sheet import GRID, TRUTH, Colour
from tests.host.pictures.conftest import Text, drawn, opened
from tests.host.pictures.test_images import CAMERA, SHAPE, Found

BLACK = np.zeros(SHAPE, np.uint8)
SENSE = np.full((480, 640), 34, np.uint8)


def test_saved_image_keeps_grey_values(tmp_path: Path) -> None:
    picture = np.random.default_rng(2).integers(0, 256, (30, 50)).astype(np.uint8)
    save_picture(picture, tmp_path / "picture.png")
    assert np.array_equal(opened(tmp_path / "picture.png"), picture)
    with Image.open(BytesIO(png(picture))) as image:
        assert image.format == "PNG"
        assert np.array_equal(np.asarray(image), picture)


def test_annotate_writes_the_star_sheet_to_a_file(tmp_path: Path) -> None:
    arguments = (BLACK, [Found(100, 80, 32349)])
    annotate(*arguments, tmp_path / "sheet.png", "sky", ["a"], None, [TrueStar(1, 9, 9)])
    other = star_sheet(*arguments, "sky", ["a"], None, [TrueStar(1, 9, 9)])
    assert np.array_equal(opened(tmp_path / "sheet.png"), np.asarray(other))


@pytest.mark.parametrize(("known", "unknown"), [(0, 0), (0, 2), (2, 0), (2, 1)])
def test_legend_explains_the_drawn_marks(known: int, unknown: int, written: list[Text]) -> None:
    stars = [Found(100, 80, 32349)] * known + [Found(300, 200, None)] * unknown
    image = star_sheet(BLACK, stars, "sky")
    for colour, number, text in (
        (IDENTIFIED, known, "identified by the device"),
        (UNKNOWN, unknown, "found, not identified"),
    ):
        assert bool(len(drawn(image, colour, SHAPE[0]))) == (text in written) == (number > 0)
    assert f"{known + unknown} stars found, {known} of them identified" in written
    assert ("Sirius" in written) == (known > 0)
    assert not any("boresight" in text or "true" in text for text in written)
    written.clear()
    star_sheet(BLACK, stars, "sky", (), CAMERA.directions)
    assert "boresight, angles from it" in written


def test_caption_counts_found_and_omitted_stars(written: list[Text]) -> None:
    stars, truth = [Found(100, 80, 32349)], [TrueStar(32349, 101, 80), TrueStar(1, 400, 50)]
    star_sheet(BLACK, stars, "sky", ["7 spots too small"], None, truth)
    caption = " ".join(written)
    assert "1 stars found, 1 of them identified" in caption
    assert "left out: 7 spots too small" in caption
    assert "1 of the 2 bright stars in the field found" in caption
    assert "true place" in caption


@pytest.mark.parametrize(("away", "found"), [(2.9, 1), (3.1, 0)])
@pytest.mark.parametrize("turned", [0, 0.8, 1.57, 4])
def test_star_counts_as_found_within_3_px(
    away: float, found: int, turned: float, written: list[Text]
) -> None:
    truth = TrueStar(1, 100 + away * np.cos(turned), 80 + away * np.sin(turned))
    star_sheet(BLACK, [Found(9, 9, 1), Found(100, 80, None)], "", (), None, [truth])
    assert f"{found} of the 1 bright stars in the field found" in " ".join(written)


def test_truth_marks_are_wider_than_found_marks() -> None:
    image = star_sheet(BLACK, [Found(100, 80, 1)], "", (), None, [TrueStar(1, 100, 80)])
    circle, ticks = drawn(image, IDENTIFIED, SHAPE[0]), drawn(image, TRUTH, SHAPE[0])
    assert np.abs(circle - (100, 80)).max() < np.abs(ticks - (100, 80)).max() < 16
    assert np.abs(ticks - (100, 80)).max(axis=1).min() > 4


@pytest.mark.parametrize("f_px", [100.0, 300.0, 600.0, 5000.0])
@pytest.mark.parametrize("centre", [(255.5, 127.5), (100.0, 200.0)])
def test_widest_angle_is_that_of_the_farthest_corner(
    f_px: float, centre: tuple[float, float]
) -> None:
    lens = type(CAMERA)(f_px, *centre).directions
    across, down = (max(at, size - 1 - at) for at, size in zip(centre, SHAPE[::-1], strict=True))
    corner = np.degrees(np.arctan2(np.hypot(across, down), f_px))
    assert corner - 0.1 <= widest_deg(lens, SHAPE) <= max(corner + 0.6, 0.5)


def test_widest_angle_is_at_most_89_5_deg() -> None:
    assert widest_deg(lambda vectors: 50 + 0 * vectors[:, :2], (100, 100)) == 89.5


def test_star_is_labelled_by_name_or_hipparcos_number() -> None:
    assert [star_name(number) for number in (24436, 91262, 7)] == ["Rigel", "Vega", "HIP 7"]


def test_names_belong_to_bright_stars() -> None:
    assert set(_NAMES) <= set(load_sky(mag_limit=3.0).hip.tolist())
    assert len(set(_NAMES.values())) == len(_NAMES)


def test_stretch_uses_the_full_range() -> None:
    picture = np.linspace(0, 200, 100 * 100).reshape(100, 100).astype(np.uint8)
    grey = stretched(picture, gamma=1.0)
    assert grey.min() == 0
    assert grey.max() == 255
    inside = (picture > 10) & (picture < 190)
    expected = 255 * (picture[inside] - 2.0) / 198
    assert np.abs(grey[inside] - expected).max() < 2.5
    assert np.all(stretched(picture)[inside] > grey[inside])


@pytest.mark.parametrize(("above", "brightness"), [(6, 0.25), (12, 0.5), (23, 23 / 24)])
def test_stretch_of_a_faint_image_is_limited(above: int, brightness: float) -> None:
    picture = np.full((50, 50), 10, np.uint8)
    picture[:20] = 10 + above
    assert stretched(picture, gamma=1.0).max() == pytest.approx(255 * brightness, abs=1)


# --- residuals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("size", "scale"), [(1.0, "20"), (0.5, "50"), (0.004, "10000")])
@pytest.mark.parametrize("turned", [0.3, 2.0, 4.5])
def test_residual_arrow_starts_at_its_place_and_is_magnified(
    size: float, scale: str, turned: float, tmp_path: Path, written: list[Text]
) -> None:
    places = np.array([[100.0, 50.0], [300.0, 200.0]])
    along = np.array([np.cos(turned), np.sin(turned)])
    save_residuals(places, np.array([size * along, -size * along]), tmp_path / "residuals.png")
    assert f"magnified {scale} times" in written[0]
    image = opened(tmp_path / "residuals.png")
    assert image.shape[:2] == (200 + 80, 300 + 80)
    arrows = drawn(image, ARROW, image.shape[0])
    for place, sign in zip(places + 40, (1, -1), strict=True):
        own = arrows[np.hypot(*(arrows - place).T) < 60] - place
        length = float(scale) * size
        assert own @ along == pytest.approx(sign * np.hypot(*own.T), abs=1.5)
        assert np.hypot(*own.T).max() == pytest.approx(length, abs=1.5)
        assert 15 < length <= 40
        dot = np.all(image[int(place[1]) - 5 :, int(place[0]) - 5 :][:10, :10] == 60, axis=2)
        y, x = np.nonzero(dot)
        assert (x.mean() - 5, y.mean() - 5) == pytest.approx((0, 0), abs=1.5)


def test_residual_plot_has_a_frame(tmp_path: Path) -> None:
    save_residuals(np.array([[0.0, 0], [99.2, 49.5]]), np.zeros((2, 2)), tmp_path / "r.png")
    image = opened(tmp_path / "r.png")
    frame = drawn(image, (190, 190, 190), image.shape[0])
    assert [*frame.min(axis=0), *frame.max(axis=0)] == [40, 40, 140, 90]
    assert image.shape[:2] == (130, 180)


# --- CubeSense ------------------------------------------------------------------------------------


def middle(image: NDArray[np.uint8], colour: Colour) -> tuple[float, float]:
    """Centre of all pixels of a colour, in px of the camera."""
    places = drawn(image, colour, 960)
    x, y = (places.min(axis=0) + places.max(axis=0)) / 4 - 0.25
    return float(x), float(y)


def test_nadir_is_marked_and_captioned(tmp_path: Path, written: list[Text]) -> None:
    fitted, truth = (10.0, -5.0, 0.0), (-20.0, 15.0)
    annotate_nadir(SENSE, np.array([[50.0, 70.0]]), fitted, tmp_path / "n.png", "Earth", truth)
    image = opened(tmp_path / "n.png")
    assert middle(image, EDGE) == pytest.approx((50, 70), abs=1)
    for colour, angles in ((FITTED, fitted[:2]), (TRUTH, truth)):
        place = pixel(Camera.NADIR, direction(*angles)[None])[0]
        assert middle(image, colour) == pytest.approx(place, abs=1)
    text = " ".join(written)
    assert "Earth 1 edges found; centre at alpha +10.00°, beta -5.00° (this program" in text
    assert "truth alpha -20.00°, beta +15.00°" in text
    legend = {"edge found on a scanned line", "centre found", "truth (unknown to the device)"}
    assert legend <= {*written}
    assert "limb fitted" not in written
    assert len(drawn(image, FITTED, 960)) < 150
    marks = (drawn(image, colour, 960) for colour in (EDGE, FITTED, TRUTH))
    sizes = [np.ptp(places, axis=0).max() / 2 for places in marks]
    assert sizes == sorted(sizes)
    assert 3 < sizes[0] < sizes[2] < 40


def test_limb_is_drawn_and_captioned(tmp_path: Path, written: list[Text]) -> None:
    annotate_nadir(SENSE, np.zeros((0, 2)), (4.0, -3.0, 50.0), tmp_path / "n.png")
    green = drawn(opened(tmp_path / "n.png"), FITTED, 960)
    rim = 2 * (limb(4.0, -3.0, 50.0) + 0.5)
    apart = np.hypot(*(green[:, None] - rim).transpose(2, 0, 1))
    centre = 2 * (pixel(Camera.NADIR, direction(4.0, -3.0)[None])[0] + 0.5)
    off = np.hypot(*(green - centre).T) > 30
    assert apart[off].min(axis=1).max() < 8
    assert apart.min(axis=0).max() < 4
    assert "radius 50.00°" in " ".join(written)
    assert "limb fitted" in written
    assert "this program tells no radius" not in " ".join(written)


def test_limb_points_have_the_same_angle_from_the_axis() -> None:
    for alpha, beta in ((0.0, 0.0), (30.0, 5.0), (3.0, -25.0)):
        rim = limb(alpha, beta, 20.0)
        axis = direction(alpha, beta)
        side = np.cross(axis, (0.6, 0.8, 0.1))
        tilt = Rotation.from_rotvec(20 * side / np.linalg.norm(side), degrees=True)
        turns = Rotation.from_rotvec(np.outer(np.arange(0, 360, 7), axis), degrees=True)
        expected = pixel(Camera.NADIR, (turns * tilt).apply(axis))
        apart = np.linalg.norm(expected[:, None] - rim, axis=2)
        assert apart.min(axis=1).max() < 3
        assert len(np.unique(rim.round(6), axis=0)) == len(rim) >= 90


def test_missing_earth_is_captioned(tmp_path: Path, written: list[Text]) -> None:
    annotate_nadir(SENSE, np.zeros((0, 2)), None, tmp_path / "n.png")
    assert "nadir camera" in written
    assert "0 edges found; no Earth found" in written
    assert "centre found" not in written
    assert "boresight, angles from it" in written
    annotate_nadir(SENSE, np.array([[50.0, 70.0]]), None, tmp_path / "n.png")
    assert middle(opened(tmp_path / "n.png"), EDGE) == pytest.approx((50, 70), abs=1)


@pytest.mark.parametrize("first", [(100, 90), (500, 90), (100, 400), (500, 400)])
def test_sun_window_is_enlarged_in_the_farthest_corner(
    first: tuple[int, int], tmp_path: Path, written: list[Text]
) -> None:
    origin = np.array(FULL_SIZE.window_origin(*first))
    side = FULL_SIZE.window
    picture = SENSE.copy()
    picture[origin[1] + 3, origin[0] + 5] = 255
    boresight = pixel(Camera.SUN, np.array([[0.0, 0.0, 1.0]]))[0]
    assert np.linalg.norm(boresight - first) > 100
    annotate_sun(picture, first, (0.0, 0.0), tmp_path / "s.png", "Sun", (1.0, 2.0))
    image = opened(tmp_path / "s.png")
    edge = drawn(image, EDGE, 960)
    near = edge[np.abs(edge / 2 - origin - side / 2).max(axis=1) < side]
    corners = [*(2 * origin), *(2 * (origin + side))]
    assert [*near.min(axis=0), *near.max(axis=0)] == pytest.approx(corners, abs=2)
    # The other one is in the corner that is farthest, and its pixels are 16 times as large.
    far = edge[np.abs(edge / 2 - origin - side / 2).max(axis=1) >= side]
    assert np.ptp(far, axis=0) == pytest.approx([16 * side, 16 * side], abs=4)
    left, top = far.min(axis=0)
    assert (left > 640) == (first[0] < 320)
    assert (top > 480) == (first[1] < 240)
    white = drawn(image, (255, 255, 255), 960)
    white = white[np.abs(white / 2 - origin - side / 2).max(axis=1) >= side]
    assert np.ptp(white, axis=0) == pytest.approx([15, 15], abs=1)
    assert white.min(axis=0) - (left, top) == pytest.approx([16 * 5, 16 * 3], abs=2)
    # It is in the very corner, in a frame of its own.
    border = 16 * (side + 8)
    x = 0 if first[0] > 320 else 1280 - border
    y = 0 if first[1] > 240 else 960 - border
    assert np.all(image[y, x : x + border] == GRID)
    assert np.all(image[y : y + border, x + border - 1] == GRID)
    assert "Sun at alpha +0.00°, beta +0.00°; truth alpha +1.00°, beta +2.00°" in written
    assert {"window that is read, enlarged in the corner", "centroid found"} <= {*written}


def test_enlarged_window_marks_found_and_true_sun(tmp_path: Path) -> None:
    angles, truth = (20.0, 10.0), (20.5, 9.5)
    found, true = (pixel(Camera.SUN, direction(*each)[None])[0] for each in (angles, truth))
    first = int(found[0]), int(found[1] - 3)
    annotate_sun(SENSE, first, angles, tmp_path / "s.png", "Sun", truth)
    image = opened(tmp_path / "s.png")
    for colour, place in ((FITTED, found), (TRUTH, true)):
        marks = drawn(image, colour, 960)
        far = np.abs(marks / 2 - found).max(axis=1) > 60
        near = (marks[~far].min(axis=0) + marks[~far].max(axis=0)) / 4 - 0.25
        assert near == pytest.approx(place, abs=1)
        edge = drawn(image, EDGE, 960)
        corner = edge[np.abs(edge / 2 - found).max(axis=1) > 60].min(axis=0)
        offset = place - (np.array(FULL_SIZE.window_origin(*first)) - 0.5)
        centre = (marks[far].min(axis=0) + marks[far].max(axis=0)) / 2
        assert centre - corner == pytest.approx(16 * offset, abs=2)
        assert np.ptp(marks[far], axis=0).max() > np.ptp(marks[~far], axis=0).max() / 2


@pytest.mark.parametrize("first", [(0, 0), (639, 479), (0, 479), (639, 0)])
def test_window_at_the_border_is_enlarged(first: tuple[int, int], tmp_path: Path) -> None:
    picture = SENSE.copy()
    picture[first[1], first[0]] = 255
    annotate_sun(picture, first, (0.0, 0.0), tmp_path / "s.png")
    white = drawn(opened(tmp_path / "s.png"), (255, 255, 255), 960)
    far = np.abs(white / 2 - first).max(axis=1) > 30
    assert 100 < far.sum() <= 256


def test_missing_sun_is_captioned(tmp_path: Path, written: list[Text]) -> None:
    annotate_sun(SENSE, (0x3FF, 0x1FF), None, tmp_path / "s.png")
    image = opened(tmp_path / "s.png")
    assert not any(len(drawn(image, colour, 960)) for colour in (EDGE, FITTED, TRUTH))
    assert "no Sun found" in written
    assert "sun camera" in written
    assert "centroid found" not in written
    assert "boresight, angles from it" in written
    annotate_sun(SENSE, (0x3FF, 0x1FF), None, tmp_path / "s.png", "Sun", (20.0, 10.0))
    place = pixel(Camera.SUN, direction(20.0, 10.0)[None])[0]
    assert middle(opened(tmp_path / "s.png"), TRUTH) == pytest.approx(place, abs=1)
