from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageFont

from cubestack.host.calibration.camera import Camera
from cubestack.host.pictures.labels import Box
from cubestack.host.pictures.sheet import GRID, PAPER, PLATE, TEXT, Entry, Shape, Sheet

from .conftest import Text, drawn

ROWS, COLUMNS = 400, 800
LENS = Camera(f_px=700, cx_px=390.0, cy_px=210.0)
CORNER_DEG = float(np.degrees(np.arctan2(np.hypot(409, 210), 700)))
RED = (255, 0, 0)
SHAPES: list[Shape] = ["circle", "square", "cross", "line", "ticks"]


def black(scale: int = 1) -> Sheet:
    return Sheet(np.zeros((ROWS // scale, COLUMNS // scale), np.uint8), scale)


def edges(places: NDArray[np.float64]) -> list[float]:
    return [*places.min(axis=0), *places.max(axis=0)]


@pytest.mark.parametrize(
    ("columns", "scale", "em"), [(200, 1, 11), (620, 2, 20), (1240, 1, 20), (682, 1, 11)]
)
def test_text_size_follows_the_image_size_within_limits(columns: int, scale: int, em: int) -> None:
    sheet = Sheet(np.zeros((60, columns), np.uint8), scale)
    assert sheet.em == em
    assert sheet.image.size == (scale * columns, scale * 60)


def test_scaled_image_repeats_each_pixel() -> None:
    picture = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20
    image = np.asarray(Sheet(picture, 5).image)
    assert np.array_equal(image[..., 1], np.kron(picture, np.ones((5, 5), np.uint8)))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("scale", [1, 2])
def test_mark_has_its_centre_and_radius(shape: Shape, scale: int) -> None:
    sheet = black(scale)
    sheet.mark(shape, np.array([150.0, 90.0]), RED, 2.0)
    ink, x, y, radius = drawn(sheet.image, RED), scale * 150.5, scale * 90.5, 2.0 * sheet.em
    half = 1 if shape == "line" else radius
    assert edges(ink) == pytest.approx([x - radius, y - half, x + radius, y + half], abs=1.5)
    apart = np.abs(ink - (x, y))
    if shape == "circle":
        assert np.all(np.abs(np.hypot(*apart.T) - radius) < 2.5)
    elif shape == "square":
        assert np.all(radius - apart.max(axis=1) < 2.5)
    else:
        assert np.all(apart.min(axis=1) < 1.5)
        near = 0.6 * radius if shape == "ticks" else 0
        assert apart.max(axis=1).min() == pytest.approx(near, abs=1.5)


@pytest.mark.parametrize("shape", SHAPES)
def test_mark_has_a_dark_outline(shape: Shape) -> None:
    sheet = Sheet(np.full((ROWS, COLUMNS), 255, np.uint8))
    sheet.mark(shape, np.array([150.0, 90.0]), RED, 2.0)
    dark = drawn(sheet.image, PLATE)
    for point in drawn(sheet.image, RED):
        assert np.abs(dark - point).max(axis=1).min() <= 2


@pytest.mark.parametrize("shape", SHAPES)
def test_mark_blocks_labels_over_its_ink_only(shape: Shape) -> None:
    sheet = black()
    sheet.mark(shape, np.array([150.0, 90.0]), RED, 2.0)
    ink = drawn(sheet.image, RED) + 0.5
    boxes = np.array([(one.left, one.top, one.right, one.bottom) for one in sheet.blocked])
    x, y = ink[:, :1], ink[:, 1:]
    over = (boxes[:, 0] - 1.5 < x) & (x < boxes[:, 2] + 1.5)
    over &= (boxes[:, 1] - 1.5 < y) & (y < boxes[:, 3] + 1.5)
    assert np.all(over.any(axis=1))
    assert np.all(over.any(axis=0))
    if shape == "ticks":  # a name may stand between two of them
        assert not any(one.overlaps(Box(155, 95, 165, 105)) for one in sheet.blocked)
    radius = 2.0 * sheet.em
    whole = [*boxes[:, :2].min(axis=0), *boxes[:, 2:].max(axis=0)]
    assert whole == pytest.approx([150.5 - radius, 90.5 - radius, 150.5 + radius, 90.5 + radius])


@pytest.mark.parametrize(
    ("place", "seen"),
    [
        *(((-0.5, -0.5), True), ((799.5, 399.5), True), ((-0.6, 9), False)),
        *(((9, -0.6), False), ((799.6, 9), False), ((9, 399.6), False)),
    ],
)
def test_marks_outside_the_image_are_omitted(place: tuple[float, float], seen: bool) -> None:
    sheet = black()
    sheet.mark("circle", np.array(place), RED, 1.0, "name")
    assert bool(len(drawn(sheet.image, RED))) == bool(sheet.blocked) == seen


def test_outline_is_closed() -> None:
    sheet = black(2)
    corners = np.array([[20.0, 30.0], [120.0, 30.0], [120.0, 80.0], [20.0, 80.0]])
    sheet.outline(corners, RED)
    ink = drawn(sheet.image, RED)
    assert edges(ink) == pytest.approx([41, 61, 241, 161], abs=1)
    for row in range(62, 160):
        assert len(ink[ink[:, 1] == row]) >= 2  # both sides, also the one that closes it


@pytest.mark.parametrize(("widest", "rings"), [(4.0, [1, 2, 3]), (4.1, [2, 4]), (31, [10, 20, 30])])
def test_rings_have_the_radius_of_their_angle(widest: float, rings: list[int]) -> None:
    sheet = black()
    sheet.grid(LENS.directions, widest)
    ink = drawn(sheet.image, GRID) - (LENS.cx_px + 0.5, LENS.cy_px + 0.5)
    away, around = np.hypot(*ink.T), np.degrees(np.arctan2(ink[:, 1], ink[:, 0])) % 360
    expected = np.array([LENS.f_px * np.tan(np.radians(ring)) for ring in rings])
    arm = sheet.em / 2
    ring_of = np.abs(away[:, None] - expected).argmin(axis=1)
    assert np.all((np.abs(away - expected[ring_of]) < 1.8) | (away < arm + 1.5))
    for number, radius in enumerate(expected):
        if radius < 190:  # whole in the picture: dashes all around
            bins = np.unique(around[(ring_of == number) & (away > arm + 2)] // 10)
            assert len(bins) == 36
    middle = drawn(sheet.image, GRID)[away < arm + 1.5]
    x, y = LENS.cx_px + 0.5, LENS.cy_px + 0.5
    assert edges(middle) == pytest.approx([x - arm, y - arm, x + arm, y + arm], abs=1.5)


def test_rings_are_labelled(written: list[Text]) -> None:
    sheet = black()
    sheet.grid(LENS.directions, CORNER_DEG)
    sheet.finished("title", "", [])
    angles = {one: one.box for one in written if one.box.bottom < ROWS}
    assert list(angles) == ["10°", "20°", "30°"]
    for text, box in angles.items():
        radius = LENS.f_px * np.tan(np.radians(float(text[:-1])))
        below = LENS.cy_px + radius * np.sin(np.pi / 4)
        # Right below of the boresight where that is in the picture, or else right of it.
        turned = np.pi / 4 if below < ROWS else 0
        at = LENS.cx_px + radius * np.cos(turned), LENS.cy_px + radius * np.sin(turned)
        beside = min(abs(box.left - at[0]), abs(at[0] - box.right))
        assert beside < 10 or abs((box.left + box.right) / 2 - at[0]) < 2
        assert abs((box.top + box.bottom) / 2 - at[1]) < 2 * sheet.em


@pytest.mark.parametrize("f_px", [130.0, 300.0, 700.0, 1500.0, 4000.0, 20000.0])
def test_scale_bar_has_the_length_of_its_angle(f_px: float, written: list[Text]) -> None:
    camera, sheet = Camera(f_px=f_px, cx_px=390.0, cy_px=210.0), black()
    sheet.grid(camera.directions, min(CORNER_DEG * 700 / f_px, 89.5))
    below = np.asarray(sheet.finished("", "", []))[ROWS:]
    told = written[-1]
    (row, *_), length, right = longest_run(np.all(below == TEXT, axis=2))
    degrees = float(told.removesuffix("°"))
    assert length == pytest.approx(min(f_px * np.tan(np.radians(degrees)), right), abs=3)
    following = {1: 2, 2: 5, 5: 10, 10: 20}
    if degrees in following:  # the longest one that is no hindrance
        assert f_px * np.tan(np.radians(following[int(degrees)])) > 0.18 * COLUMNS
    assert degrees == 1 or length <= 0.18 * COLUMNS + 3
    assert right < told.box.left < told.box.right <= COLUMNS
    assert told.box.left - right < sheet.em
    assert abs(row + ROWS - (told.box.top + told.box.bottom) / 2) < 0.4 * sheet.em
    # Both of its ends are marked.
    for end in (right, right - length + 1):
        if end > 0:
            column = np.all(below[:, max(round(end) - 1, 0) : round(end) + 2] == TEXT, axis=2)
            assert column.any(axis=1).sum() == pytest.approx(0.7 * sheet.em, abs=2)


def longest_run(ink: NDArray[np.bool_]) -> tuple[list[int], int, int]:
    """Rows with the longest run of ink, its length, and its last column."""
    best: dict[int, tuple[int, int]] = {}
    for row, line in enumerate(ink):
        changes = np.flatnonzero(np.diff(np.concatenate([[0], line, [0]])))
        runs = [(int(b - a), int(b) - 1) for a, b in zip(changes[::2], changes[1::2], strict=True)]
        if runs:
            best[row] = max(runs)
    length, end = max(best.values())
    return [row for row, found in best.items() if found == (length, end)], length, end


def test_names_are_beside_their_marks_on_a_plate(written: list[Text]) -> None:
    sheet = Sheet(np.full((ROWS, COLUMNS), 255, np.uint8))
    places = {"Rigel": (100.0, 100.0), "Vega": (500.0, 300.0), "Mira": (790.0, 200.0)}
    for name, place in places.items():
        sheet.mark("circle", np.array(place), RED, 1.0, name)
    image = np.asarray(sheet.finished("", "", []))
    for one in written[:3]:
        x, y = places[one]
        box, radius = one.box, float(sheet.em)
        assert abs((box.top + box.bottom) / 2 - y) < 0.5 * sheet.em
        gap = x - box.right if one == "Mira" else box.left - x
        assert radius < gap < radius + 8
        inside = image[int(box.top) : int(box.bottom), int(box.left) : int(box.right)]
        assert not np.any(np.all(inside == 255, axis=2))
        assert np.any(np.all(inside == RED, axis=2))


def test_names_without_room_are_counted(written: list[Text]) -> None:
    sheet = Sheet(np.zeros((40, 200), np.uint8))
    for _ in range(40):
        sheet.mark("circle", np.array([100.0, 20.0]), RED, 0.5, "Betelgeuse")
    sheet.finished("title", "told", [])
    names = written.count("Betelgeuse")
    below = " ".join(one for one in written if one != "Betelgeuse")
    assert 0 < names < 40
    assert below == f"title told; names without room: {40 - names}"


def test_ring_labels_without_room_are_omitted(written: list[Text]) -> None:
    sheet = black()
    sheet.grid(LENS.directions, CORNER_DEG)
    sheet.blocked.append(Box(0, 0, COLUMNS, ROWS))
    sheet.finished("title", "told", [])
    assert written[:2] == ["title", "told"]
    written.clear()
    black().finished("title", "told", [])  # no grid, no scale bar
    assert written == ["title", "told"]


def test_names_do_not_cover_marks(written: list[Text]) -> None:
    sheet = black()
    sheet.mark("ticks", np.array([150.0, 100.0]), RED, 2.0)
    sheet.mark("circle", np.array([120.0, 100.0]), (0, 255, 0), 0.5, "a longer name")
    before = drawn(sheet.image, RED)
    image = sheet.finished("", "", [])
    (name,) = (one for one in written if one == "a longer name")
    assert len(drawn(image, RED)) == len(before)
    assert name.box.right <= COLUMNS


LONG = " ".join(f"word{number}" for number in range(60))


def test_caption_and_legend_fit_below_the_image(written: list[Text]) -> None:
    sheet = black()
    sheet.grid(LENS.directions, CORNER_DEG)
    legend = [Entry("circle", RED, f"entry {number} of the legend") for number in range(9)]
    image = sheet.finished(f"Title {LONG}", LONG, legend)
    below = [one for one in written if one.box.top >= ROWS]
    assert " ".join(one for one in below if "word" in one) == f"Title {LONG} {LONG}"
    assert [one for one in below if "entry" in one] == [one.text for one in legend]
    for one in below:
        assert sheet.em <= one.box.left < one.box.right <= image.width - 0.5 * sheet.em
        assert one.box.bottom <= image.height
    for one, other in combinations(below, 2):
        assert not one.box.overlaps(other.box), (one, other)
    # Most of each line is used, and little paper is left empty.
    starts = [one for one in below if one.startswith("Title")]
    assert starts[0].box.right > 0.85 * image.width
    assert image.height - max(one.box.bottom for one in below) < 1.5 * sheet.em
    assert image.getpixel((0, ROWS)) == PAPER


def test_legend_texts_have_their_mark_at_the_left(written: list[Text]) -> None:
    sheet = black()
    sheet.grid(LENS.directions, CORNER_DEG)
    colours = [(250, 10 * number, 0) for number in range(10)]
    legend = [Entry(SHAPES[n % 5], colour, f"what {n} is") for n, colour in enumerate(colours)]
    image = sheet.finished("title", "told", legend)
    for entry in legend:
        (text,) = (one.box for one in written if one == entry.text)
        left, top, right, bottom = edges(drawn(image, entry.colour))
        assert right - left == pytest.approx(sheet.em, abs=2)
        assert 0 < text.left - right < sheet.em
        assert abs((text.top + text.bottom) / 2 - (top + bottom) / 2) < 0.4 * sheet.em
    rows = {one.box.top for one in written if one.startswith("what")}
    assert len(rows) > 1
    bar = drawn(image, TEXT)
    assert ImageFont.load_default(sheet.em).getlength("what 9 is") < len(bar)


def test_save_writes_the_whole_sheet(tmp_path: Path) -> None:
    sheet, legend = black(), [Entry("circle", RED, "what it is")]
    sheet.mark("circle", np.array([100.0, 100.0]), RED)
    sheet.save(tmp_path / "sheet.png", "title", "told", legend)
    with Image.open(tmp_path / "sheet.png") as image:
        assert np.array_equal(
            np.asarray(image), np.asarray(sheet.finished("title", "told", legend))
        )
