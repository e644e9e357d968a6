"""Diagrams as SVG: each part has its place, nothing is over anything else, all can be read."""

import xml.etree.ElementTree as ElementTree
from itertools import combinations, pairwise
from typing import NamedTuple

import pytest

from docs.diagrams.blocks import BOX_HEIGHT, BOX_WIDTH, Block, Line, blocks
from docs.diagrams.style import DARK, LIGHT
from docs.diagrams.timing import LEFT, PS_PER, WIDTH, levels, timing, values

SVG = "{http://www.w3.org/2000/svg}"
LETTER = 7.5
"""Width of a letter in these sizes, px, roughly."""


class Drawing:
    """The elements of an SVG."""

    def __init__(self, text: str) -> None:
        self.root = ElementTree.fromstring(text)
        left, top, self.width, self.height = map(float, self.root.attrib["viewBox"].split())
        assert left == top == 0

    def all(self, tag: str, kind: str) -> list[ElementTree.Element]:
        """Elements of a tag and class."""
        return [one for one in self.root.iter(SVG + tag) if kind in one.get("class", "").split()]

    def texts(self, kind: str) -> list[tuple[str, float, float]]:
        """Texts of a class, with their places."""
        return [
            (one.text or "", float(one.attrib["x"]), float(one.attrib["y"]))
            for one in self.all("text", kind)
        ]


class Box(NamedTuple):
    left: float
    top: float
    right: float
    bottom: float

    def holds(self, x: float, y: float) -> bool:
        return self.left <= x <= self.right and self.top <= y <= self.bottom


def boxes(drawing: Drawing, kind: str) -> list[Box]:
    found = []
    for one in drawing.all("rect", kind):
        x, y = float(one.get("x", 0)), float(one.get("y", 0))
        found.append(Box(x, y, x + float(one.attrib["width"]), y + float(one.attrib["height"])))
    return found


def wave(one: ElementTree.Element) -> list[tuple[float, float]]:
    """Corners of a path of M, H and V."""
    begin, rest = one.attrib["d"].removeprefix("M").split("H", 1)
    x, y = map(float, begin.split())
    corners = [(x, y)]
    for part in rest.split("H"):
        along, *down = part.split("V")
        x = float(along)
        corners.append((x, y))
        if down:
            y = float(down[0])
            corners.append((x, y))
    return corners


LANES = [
    levels("ACK", [(0, 1), (1_250, 0), (1_750, 1)]),
    values("state", [(0, 7), (1_500, "B")], {"7": "seven"}),
    values("late", [(1_600, "C"), (1_800, "D<E")]),
    levels("low", [(500, 0)]),
    values("empty", []),
]


@pytest.fixture
def drawing() -> Drawing:
    return Drawing(timing(LANES, 1_000, 2_000, "ns", 0.25))


def at(time: float) -> float:
    return LEFT + WIDTH * (time - 1_000) / 1_000


def test_timing_diagram_wave_changes_at_the_right_times(drawing: Drawing) -> None:
    ack, low = map(wave, drawing.all("path", "wave"))
    high_y, low_y = ack[0][1], ack[2][1]
    assert high_y < low_y
    assert [x for x, _ in ack] == pytest.approx(
        [at(t) for t in (1000, 1250, 1250, 1750, 1750, 2000)]
    )
    assert [y for _, y in ack] == [high_y, high_y, low_y, low_y, high_y, high_y]
    assert [x for x, _ in low] == pytest.approx([at(1000), at(2000)])
    assert low[0][1] == low[1][1] > low_y


def test_timing_diagram_draws_one_labelled_box_per_value(drawing: Drawing) -> None:
    found = [(one.left, one.right) for one in boxes(drawing, "box")]
    ends = [(1000, 1500), (1500, 2000), (1000, 1600), (1600, 1800), (1800, 2000)]
    for (left, right), (begin, end) in zip(found, ends, strict=True):
        assert (left, right) == pytest.approx((at(begin), at(end)), abs=0.11)
    told = drawing.texts("value")
    assert [text for text, *_ in told] == ["seven", "B", "C", "C", "D<E"]
    for (_, x, y), box in zip(told, boxes(drawing, "box"), strict=True):
        assert x == pytest.approx((box.left + box.right) / 2, abs=0.11)
        assert box.holds(x, y)


def test_timing_diagram_names_are_left_of_their_lanes(drawing: Drawing) -> None:
    names = drawing.texts("name")
    assert [name for name, *_ in names] == ["ACK", "state", "late", "low", "empty"]
    assert all(x < LEFT for _, x, _ in names)
    heights = [y for *_, y in names]
    steps = {round(after - before, 3) for before, after in pairwise(heights)}
    assert len(steps) == 1
    assert steps.pop() > 20
    (first, last) = (box for box in boxes(drawing, "box")[:2])
    assert first.top == last.top
    assert first.top < heights[1] < first.bottom
    curve = wave(drawing.all("path", "wave")[0])
    assert min(y for _, y in curve) < heights[0] < max(y for _, y in curve)


def test_timing_axis_has_marks_from_the_start(drawing: Drawing) -> None:
    marks = drawing.texts("axis")
    assert [text for text, *_ in marks] == ["0", "0.25", "0.5", "0.75", "1 ns"]
    assert [x for _, x, _ in marks] == pytest.approx(
        [LEFT + WIDTH * n / 4 for n in range(5)], abs=0.1
    )
    lines = [one.attrib["d"] for one in drawing.all("path", "grid")]
    for (_, x, y), line in zip(marks, lines, strict=True):
        place, (top, bottom) = line[1:].split()[0], line.split()[1].split("V")
        assert float(place) == pytest.approx(x, abs=0.1)
        assert y < float(top) < boxes(drawing, "box")[0].top
        assert boxes(drawing, "box")[-1].bottom < float(bottom) <= drawing.height


def test_diagram_texts_are_inside_the_drawing(drawing: Drawing) -> None:
    (paper,) = boxes(drawing, "paper")
    assert paper == (0, 0, drawing.width, drawing.height)
    assert drawing.width > LEFT + WIDTH
    for kind in ("axis", "name", "value"):
        assert all(0 < x < drawing.width and 8 < y < drawing.height
                   for _, x, y in drawing.texts(kind))  # fmt: skip


@pytest.mark.parametrize(("unit", "ps"), [("s", 1e12), ("ms", 1e9), ("us", 1e6), ("ns", 1e3)])
def test_timing_axis_supports_each_unit(unit: str, ps: float) -> None:
    assert PS_PER[unit] == ps
    marks = Drawing(timing([], 0, int(2 * ps), unit, 1)).texts("axis")
    assert [text for text, *_ in marks] == ["0", "1", f"2 {unit}"]


@pytest.mark.parametrize(("length", "told"), [(10, True), (11, False)])
def test_timing_value_is_labelled_only_if_its_text_fits(length: int, told: bool) -> None:
    lane = values("x", [(0, "w" * length), (80, "")])
    drawing = Drawing(timing([lane], 0, WIDTH, "ns", 1))
    assert bool(drawing.texts("value")) == told
    assert len(boxes(drawing, "box")) == 1


@pytest.mark.parametrize(("start", "end", "step"), [(5, 5, 1), (6, 5, 1), (0, 5, 0), (0, 5, -1)])
def test_timing_diagram_rejects_an_empty_time_span(start: int, end: int, step: float) -> None:
    with pytest.raises(ValueError, match="nothing to show"):
        timing([], start, end, "ns", step)


# --- blocks ---------------------------------------------------------------------------------------

PARTS = {
    "a": Block(0, 0, "A & B", "first"),
    "b": Block(1, 0, "B"),
    "c": Block(1, 1.5, "C", "below"),
    "d": Block(0, 1.5, "D"),
}
LINES = [
    Line("a", "b", "over\nunder"),
    Line("b", "c", "down\nmore", both=True),
    Line("c", "d", "back"),
    Line("d", "a", "up"),
]


@pytest.fixture
def parts() -> Drawing:
    return Drawing(blocks(PARTS, LINES))


def test_diagram_boxes_are_aligned_and_do_not_overlap(parts: Drawing) -> None:
    a, b, c, d = boxes(parts, "box")
    assert {(one.right - one.left, one.bottom - one.top) for one in (a, b, c, d)} == {
        (BOX_WIDTH, BOX_HEIGHT)
    }
    assert a.left == d.left < a.right < b.left == c.left
    assert a.top == b.top < a.bottom < c.top == d.top
    (paper,) = boxes(parts, "paper")
    assert paper == (0, 0, parts.width, parts.height)
    # As far from one side as from the other.
    assert a.left == parts.width - b.right > 0
    assert a.top == parts.height - c.bottom == a.left


def test_diagram_titles_and_labels_are_inside_their_boxes(parts: Drawing) -> None:
    found = dict(zip(PARTS, boxes(parts, "box"), strict=True))
    titles = parts.texts("title")
    assert [text for text, *_ in titles] == ["A & B", "B", "C", "D"]
    labels = {text: (x, y) for text, x, y in parts.texts("label")}
    for (_, x, y), (name, box) in zip(titles, found.items(), strict=True):
        assert x == (box.left + box.right) / 2
        assert box.top + 12 < y < box.bottom - 4
        if PARTS[name].label:
            below = labels[PARTS[name].label]
            assert below[0] == x
            assert y + 12 < below[1] < box.bottom - 4
    # Alone, a title is lower than with a line below it.
    assert titles[1][2] > titles[0][2]


def test_diagram_arrows_connect_boxes_with_labels_beside_them(parts: Drawing) -> None:
    a, b, c, d = boxes(parts, "box")
    across, down, back, up = (one.attrib["d"] for one in parts.all("path", "line"))
    labels = {text: (x, y) for text, x, y in parts.texts("label")}
    level = (a.top + a.bottom) / 2
    assert across == f"M{a.right:g} {level:g}H{b.left:g}"
    assert labels["over"][0] == labels["under"][0] == (a.right + b.left) / 2
    assert level - 12 < labels["over"][1] < level - 3
    assert level + 11 < labels["under"][1] < level + 24
    middle = (b.left + b.right) / 2
    assert down == f"M{middle:g} {b.bottom:g}V{c.top:g}"
    assert middle < labels["down"][0] == labels["more"][0] < middle + 20
    assert labels["more"][1] - labels["down"][1] > 12
    assert b.bottom < labels["down"][1] < labels["more"][1] < c.top
    low = (c.top + c.bottom) / 2
    assert back == f"M{c.left:g} {low:g}H{d.right:g}"
    side = (d.left + d.right) / 2
    assert up == f"M{side:g} {d.top:g}V{a.bottom:g}"
    heads = [("marker-end" in one.attrib, "marker-start" in one.attrib)
             for one in parts.all("path", "line")]  # fmt: skip
    assert heads == [(True, False), (True, True), (True, False), (True, False)]


def test_no_text_is_over_another_or_a_line(parts: Drawing) -> None:
    texts = [one for kind in ("title", "label") for one in parts.texts(kind) if one[0]]
    assert len(texts) == 4 + 2 + 6
    for (one, x, y), (other, to_x, to_y) in combinations(texts, 2):
        apart = abs(x - to_x) > LETTER * (len(one) + len(other)) / 2 or abs(y - to_y) >= 12
        assert apart, (one, other)


def test_diagram_rejects_diagonal_connections() -> None:
    with pytest.raises(ValueError, match="a and c are neither in one row nor in one column"):
        blocks(PARTS, [Line("a", "c", "")])


def test_lines_to_a_tall_box_are_level_with_the_other_boxes() -> None:
    tall = {"a": Block(0, 0, "A"), "b": Block(0, 1, "B"), "tall": Block(1, 0, "T", rows=2)}
    drawing = Drawing(blocks(tall, [Line("a", "tall", ""), Line("tall", "b", "")]))
    a, b, high = boxes(drawing, "box")
    levels = [one.attrib["d"].split("H")[0].split()[1] for one in drawing.all("path", "line")]
    assert [float(y) for y in levels] == [(a.top + a.bottom) / 2, (b.top + b.bottom) / 2]
    assert (high.top, high.bottom) == (a.top, b.bottom)


def test_both_colour_schemes_have_the_same_rules() -> None:
    assert LIGHT.keys() == DARK.keys()
    style = Drawing(blocks(PARTS, LINES)).root.findtext(SVG + "style") or ""
    usual, night = style.split("@media(prefers-color-scheme:dark)")
    assert all(f"{one}{{{rule}}}" in usual for one, rule in LIGHT.items())
    assert all(f"{one}{{{rule}}}" in night for one, rule in DARK.items())
