"""Timing and block diagrams: what stands where in the SVG."""

import re
import xml.etree.ElementTree as ElementTree

import pytest

from cubestack.host.pictures.blocks import Block, Line, blocks
from cubestack.host.pictures.timing import LEFT, WIDTH, levels, timing, values


def test_an_edge_stands_where_its_time_is() -> None:
    lane = levels("ACK", [(0, 0), (1_500_000, 1), (9_000_000, 0)])
    drawing = timing([lane], 1_000_000, 2_000_000, "us", 0.5)
    (wave,) = re.findall(r'class="wave" d="M([\d.]+) ([\d.]+)H([\d.]+)V([\d.]+)H([\d.]+)"', drawing)
    start, low, edge, high, end = map(float, wave)
    assert (start, edge, end) == (LEFT, LEFT + WIDTH / 2, LEFT + WIDTH)
    assert high < low
    assert re.findall(r'class="axis"[^>]*>([^<]+)', drawing) == ["0", "0.5", "1 us"]


def test_values_have_boxes_and_words_where_there_is_room() -> None:
    lane = values("task", [(0, "A<B"), (500, ""), (900, "TOO_LONG_FOR_IT")])
    drawing = timing([lane], 0, 1000, "ns", 1)
    ElementTree.fromstring(drawing)
    boxes = re.findall(r'class="bus" x="([\d.]+)"[^>]*width="([\d.]+)"', drawing)
    assert [float(x) for x, _ in boxes] == [LEFT, LEFT + WIDTH * 0.9]
    assert [float(width) for _, width in boxes] == pytest.approx([WIDTH / 2, WIDTH / 10])
    assert re.findall(r'class="value"[^>]*>([^<]+)', drawing) == ["A&lt;B"]


def test_no_time_is_refused() -> None:
    with pytest.raises(ValueError, match="nothing to show"):
        timing([], 5, 5, "ns", 1)


def test_lines_end_at_their_boxes() -> None:
    boxes = {"a": Block(0, 0, "A", "first"), "b": Block(1, 0, "B"), "c": Block(1, 1, "C")}
    drawing = blocks(boxes, [Line("a", "b", "over\nunder"), Line("b", "c", "", both=True)])
    ElementTree.fromstring(drawing)
    left, right = re.findall(r'class="box" x="([\d.]+)"[^>]*width="(\d+)"', drawing)[:2]
    start, end = re.findall(r'class="line" d="M([\d.]+) [\d.]+H([\d.]+)"', drawing)[0]
    assert float(start) == float(left[0]) + float(left[1])
    assert end == right[0]
    assert drawing.count("marker-start=") == 1
    with pytest.raises(ValueError, match="neither in one row"):
        blocks(boxes, [Line("a", "c", "")])


def test_a_tall_box_has_its_lines_in_the_rows_of_the_others() -> None:
    boxes = {"a": Block(0, 0, "A"), "b": Block(0, 1, "B"), "tall": Block(1, 0, "T", rows=2)}
    drawing = blocks(boxes, [Line("a", "tall", ""), Line("tall", "b", "")])
    tops = [
        (float(y), float(height))
        for y, height in re.findall(
            r'class="box" x="[\d.]+" y="([\d.]+)"[^>]*height="([\d.]+)"', drawing
        )
    ]
    levels = [float(y) for y in re.findall(r'class="line" d="M[\d.]+ ([\d.]+)H', drawing)]
    assert levels == [y + height / 2 for y, height in tops[:2]]
    assert tops[2] == (tops[0][0], tops[1][0] + tops[1][1] - tops[0][0])
