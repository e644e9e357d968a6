"""A source with faults: edges and pixels that come out, against a list of clocks made by hand."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.common.image_sensor import StreamSegment
from cubestack.emulator.faults import table
from cubestack.emulator.faults.injection import Injection
from cubestack.emulator.faults.pixels import FaultySource
from cubestack.emulator.rtl.pixel_clock import LoadedSegment
from tests.together import together

ROWS, COLUMNS, LINE = 5, 6, 9
PERIOD = Fraction(1000, 3)
BLANK = 40
FRAME_PS = int((ROWS * LINE + BLANK) * PERIOD)


@dataclass
class Camera:
    """Frames one after the other, each with blanking behind it; pixels count up."""

    period: Fraction = PERIOD
    line_clocks: int = LINE
    active_columns: int = COLUMNS
    picture: np.ndarray = field(
        default_factory=lambda: np.arange(ROWS * COLUMNS, dtype=np.uint8).reshape(ROWS, COLUMNS)
    )

    def segment_at(self, time_ps: int) -> StreamSegment:
        number = 0
        while True:
            first = number * (ROWS * LINE + BLANK)
            for clocks, rows in ((ROWS * LINE, ROWS), (BLANK, 0)):
                start = int(first * PERIOD)
                if start + int(clocks * PERIOD) > time_ps:
                    pixels = (lambda: self.picture) if rows else None
                    return StreamSegment(start, clocks, int(rows > 0), rows, pixels)
                first += clocks
            number += 1


Clock = tuple[int, int, int, int]  # time, line pin, pixel, frame pin


def clocks(source: Any, until_ps: int) -> Iterator[Clock]:
    """Rising edges with what stands on the lines, as an engine follows a source."""
    time_ps = 0
    while (segment := source.segment_at(time_ps)) is not None:
        loaded = LoadedSegment.of(source, segment)
        if segment.rows:
            loaded.render()
        for sample in range(segment.clocks):
            rise_ps = loaded.time_of(2 * sample)
            if rise_ps >= until_ps:
                return
            yield (rise_ps, *loaded.sample(sample), segment.vsync)
        following = source.segment_at(loaded.end_ps)
        same = following is not None and following.start_ps == segment.start_ps
        time_ps = loaded.end_ps + same


def faulty(*faults: Any, seed: int = 1) -> tuple[FaultySource, list[str]]:
    log: list[str] = []
    injections = [Injection(n, fault, "imager", 0, None, seed) for n, fault in enumerate(faults)]
    return FaultySource(Camera(), lambda _time, _by, text: log.append(text), injections), log


def near(found: list[Clock], expected: list[Clock]) -> None:
    """The same clocks, but for 1 ps of rounding."""
    assert [clock[1:] for clock in found] == [clock[1:] for clock in expected]
    assert all(abs(a[0] - b[0]) <= 1 for a, b in zip(found, expected, strict=True))


CLEAN = list(clocks(Camera(), 3 * FRAME_PS))


def test_pixel_stream_is_unchanged_without_faults() -> None:
    assert list(clocks(faulty()[0], 3 * FRAME_PS)) == CLEAN
    near(list(clocks(faulty(table.ClockLost(rate=0.0, row=1))[0], 3 * FRAME_PS)), CLEAN)


@together("column", range(COLUMNS))
@together("row", [0, 2, ROWS - 1])
def test_lost_clock_removes_one_pixel_edge(row: int, column: int) -> None:
    source, log = faulty(table.ClockLost(row=row, column=column))
    lost = {n * (ROWS * LINE + BLANK) + row * LINE + column for n in range(3)}
    expected = [clock for number, clock in enumerate(CLEAN) if number not in lost]
    near(list(clocks(source, 3 * FRAME_PS)), expected)
    assert log[:3] == [f"line {row}, column {column}"] * 3


@pytest.mark.parametrize("column", range(COLUMNS))
def test_extra_clock_comes_half_a_period_later(column: int) -> None:
    source, _ = faulty(table.ClockExtra(row=2, column=column))
    expected = list(CLEAN)
    for n in reversed(range(3)):
        place = n * (ROWS * LINE + BLANK) + 2 * LINE + column
        time_ps, *levels = CLEAN[place]
        expected.insert(place + 1, (time_ps + int(PERIOD / 2), *levels))  # type: ignore[arg-type]
    near(list(clocks(source, 3 * FRAME_PS)), expected)


def test_missing_line_is_read_as_zeros() -> None:
    source, _ = faulty(table.LineMissing(row=3))
    expected = []
    for number, clock in enumerate(CLEAN):
        line = number % (ROWS * LINE + BLANK) // LINE
        expected.append((clock[0], 0, 0, clock[3]) if line == 3 else clock)
    near(list(clocks(source, 3 * FRAME_PS)), expected)


def test_pixel_faults_on_several_lines_combine() -> None:
    source, log = faulty(
        table.ClockLost(row=1, column=1),
        table.LineMissing(row=3),
        table.ClockExtra(row=4, column=0),
    )
    found = [clock for clock in clocks(source, FRAME_PS) if clock[0] < FRAME_PS]
    assert len(found) == ROWS * LINE + BLANK
    assert log[:3] == ["line 1, column 1", "line 3", "line 4, column 0"]


def test_random_fault_positions_repeat_with_the_seed() -> None:
    logs = []
    for seed in (1, 1, 2):
        source, log = faulty(table.ClockLost(), seed=seed)
        list(clocks(source, 9 * FRAME_PS))
        logs.append(log)
    assert logs[0] == logs[1] != logs[2]
    assert len(set(logs[0])) > 5


def rendered(source: FaultySource) -> np.ndarray:
    return source.segment_at(0).pixels()


def test_pixel_and_column_faults_change_their_pixels() -> None:
    clean = Camera().picture
    expected = clean.copy()
    expected[1, 2], expected[3, 4], expected[:, 5] = 255, 0, 9
    source, _ = faulty(
        table.PixelHot(x=2, y=1), table.PixelDead(x=4, y=3), table.ColumnDefect(x=5, level=9)
    )
    np.testing.assert_array_equal(rendered(source), expected)
    assert clean[1, 2] == 8  # the camera's own picture is not touched


def test_blooming_goes_along_the_column() -> None:
    expected = Camera().picture.copy()
    expected[2:, 5] = 255
    source, _ = faulty(table.Blooming(threshold=29, length=2))
    np.testing.assert_array_equal(rendered(source), expected)


def test_pixel_fault_affects_only_lines_within_its_time() -> None:
    source, _ = faulty(table.ColumnDefect(x=0))
    source.injections[0].start_ps = int(LINE * PERIOD)
    source.injections[0].end_ps = int(3 * LINE * PERIOD)
    assert list(rendered(source)[:, 0] == 255) == [False, True, True, False, False]


def test_a_dead_camera_has_no_clock() -> None:
    source, _ = faulty(table.CameraDead())
    assert source.segment_at(0) is None
