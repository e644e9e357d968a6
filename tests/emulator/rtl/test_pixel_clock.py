"""Edges and samples of one segment, counted one by one; and a camera that repeats a frame."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.rtl.benchmark import RepeatedFrame
from cubestack.emulator.rtl.pixel_clock import LoadedSegment

IMAGE = np.arange(1, 13, dtype=np.uint8).reshape(3, 4)


@dataclass
class Source:
    """Three lines of four pixels, six clocks each."""

    period: Fraction = Fraction(1000, 7)
    line_clocks: int = 6
    active_columns: int = 4

    def segment_at(self, time_ps: int) -> None: ...


@dataclass
class Segment:
    start_ps: int = 1001
    clocks: int = 18
    vsync: int = 1
    rows: int = 3
    pixels: Callable[[], Any] | None = lambda: IMAGE


def loaded(**changes: Any) -> LoadedSegment:
    return LoadedSegment.of(Source(), replace(Segment(), **changes))


def test_pixel_clock_edges_are_at_rounded_down_half_periods() -> None:
    one = loaded()
    assert one.edges == 36
    times = [int(1001 + k * Fraction(1000, 14)) for k in range(37)]
    assert [one.time_of(edge) for edge in range(37)] == times
    assert one.end_ps == times[-1]
    for time_ps in range(900, times[-1] + 200):
        following = sum(at < time_ps for at in times[:-1])
        assert one.first_edge(time_ps) == following


def test_pixel_clock_samples_lines_then_low() -> None:
    one = loaded()
    lines = np.zeros((3, 6), int)
    lines[:, :4] = 1
    assert [one.sample(n) for n in range(18)] == [(level, 0) for level in lines.ravel().tolist()]
    assert one.render() is IMAGE
    pixels = np.zeros((3, 6), int)
    pixels[:, :4] = IMAGE
    expected = list(zip(lines.ravel().tolist(), pixels.ravel().tolist(), strict=True))
    assert [one.sample(n) for n in range(18)] == expected
    # The run of low samples ends where the next line begins.
    for n in (4, 5, 10, 11, 16, 17):
        rest = [line for line, _ in expected[n:]]
        assert one.low_until(n) == n + len(list(itertools.takewhile(lambda level: not level, rest)))


def test_blanking_is_low_throughout() -> None:
    one = loaded(rows=0, clocks=7, pixels=None)
    assert [one.sample(n) for n in range(7)] == [(0, 0)] * 7
    assert {one.low_until(n) for n in range(7)} == {7}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"clocks": 17}, "a segment of 3 rows of 6 clocks has 18 clocks, not 17"),
        ({"clocks": 0, "rows": 0}, "a segment needs at least one clock, not 0"),
    ],
)
def test_segment_rejects_inconsistent_clock_counts(changes: dict[str, int], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        loaded(**changes)
    assert loaded(clocks=1, rows=0).edges == 2


@pytest.mark.parametrize(
    ("pixels", "words"),
    [
        (None, "a segment of 3 rows needs pixels"),
        (lambda: IMAGE.astype(np.int8), r"uint8 of shape \(3, 4\), not int8"),
        (lambda: IMAGE[:2], r"of shape \(3, 4\), not uint8 of shape \(2, 4\)"),
        (lambda: np.asfortranarray(IMAGE), "pixels must be C-contiguous"),
    ],
)
def test_segment_rejects_pixels_of_wrong_shape_or_type(pixels: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        loaded(pixels=pixels).render()


@pytest.mark.parametrize("blank", [0, 5])
def test_repeated_frames_follow_each_other_without_a_gap(blank: int) -> None:
    camera = RepeatedFrame(IMAGE, Fraction(1000, 7), 6, blank)
    assert (camera.active_columns, camera.clocks) == (4, 18 + blank)
    now, clocks, kinds = 0, 0, []
    for _ in range(8):
        segment = camera.segment_at(now)
        assert segment.start_ps == int(clocks * camera.period)
        end = int((clocks + segment.clocks) * camera.period)
        for time_ps in (now + 1, end - 1):
            assert camera.segment_at(time_ps).start_ps == segment.start_ps
        if segment.rows:
            assert LoadedSegment.of(camera, segment).render() is IMAGE
        else:
            assert (segment.clocks, segment.pixels) == (blank, None)
        assert segment.vsync == 1
        kinds.append(segment.rows)
        now, clocks = end, clocks + segment.clocks
    assert kinds == ([0, 3] * 4 if blank else [3] * 8)
