from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.aramis.ppi import Ppi
from cubestack.emulator.camera.common.image_sensor import StreamSegment
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mt9m001.lens import CONDITION
from cubestack.emulator.camera.mt9m001.sensor import Mt9m001
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S, Kernel
from cubestack.firmware_model.aramis.hardware import FrameEnd

LINE, COLUMNS, ROWS, PERIOD = 12, 8, 6, 1000
BLANK = 50
FRAME = ROWS * LINE + BLANK


class Lines:
    """Frames of six lines, the number of the frame in every pixel; rows cut from ``short`` on."""

    line_clocks, active_columns = LINE, COLUMNS
    period = Fraction(PERIOD)

    on_change: Callable[[], None]
    alive, rows = True, ROWS

    def __init__(self, phase: int) -> None:
        self.phase = phase

    def segment_at(self, time_ps: int) -> StreamSegment | None:
        if not self.alive:
            return None
        frame, clock = divmod(time_ps // PERIOD + self.phase, FRAME)
        start = (frame * FRAME - self.phase) * PERIOD
        valid = self.rows * LINE
        if clock < valid:
            pixels = np.full((self.rows, COLUMNS), frame, np.uint8)
            return StreamSegment(start, valid, 1, self.rows, lambda: pixels)
        return StreamSegment(start + valid * PERIOD, FRAME - valid, 0, 0, None)

    def frame_from(self, time_ps: int) -> RollingShutter | None:
        return RollingShutter(time_ps, Fraction(LINE * PERIOD), 1, 1)


class Bench:
    """A camera whose frame has just ended, by default."""

    def __init__(self, lines: Any = None) -> None:
        self.kernel = Kernel()
        self.lines = lines or Lines(ROWS * LINE)
        self.ppi = Ppi(self.kernel, self.lines)
        self.ends: list[tuple[int, FrameEnd]] = []
        self.ppi.on_end = lambda end: self.ends.append((self.kernel.now, end))
        self.target = np.full((ROWS, COLUMNS), 99, np.uint8)

    def run(self, clocks: int) -> list[tuple[int, FrameEnd]]:
        self.kernel.advance_to(self.kernel.now + clocks * PERIOD)
        return self.ends


def test_skips_the_frame_in_progress_and_stores_the_next() -> None:
    bench = Bench(Lines(5))
    bench.ppi.start(bench.target)
    assert bench.ppi.busy
    stored_ps = (FRAME - 5 + (ROWS - 1) * LINE + COLUMNS) * PERIOD
    assert bench.run(2 * FRAME) == [(stored_ps, FrameEnd.STORED)]
    assert (bench.target == 1).all()
    assert not bench.ppi.busy
    assert bench.ppi.stored.readout_ps == (FRAME - 5) * PERIOD


def test_stores_only_the_requested_lines() -> None:
    bench, target = Bench(), np.zeros((2, COLUMNS), np.uint8)
    bench.ppi.start(target)
    assert bench.run(FRAME) == [((BLANK + LINE + COLUMNS) * PERIOD, FrameEnd.STORED)]
    assert (target == 1).all()


def test_reports_short_frames_and_wrong_lines() -> None:
    bench = Bench()
    bench.lines.rows = ROWS - 2
    bench.ppi.start(bench.target)
    assert [end for _, end in bench.run(2 * FRAME)] == [FrameEnd.TOO_SHORT]
    assert (bench.target == 99).all()
    wide = np.full((ROWS, COLUMNS + 3), 99, np.uint8)
    bench.lines.rows = ROWS
    bench.ppi.start(wide)
    assert bench.run(3 * FRAME)[-1][1] is FrameEnd.WRONG_LINES
    assert (wide[:, :COLUMNS] != 99).all()
    assert (wide[:, COLUMNS:] == 99).all()


def test_dead_camera_never_completes_a_frame_and_stop_recovers() -> None:
    bench = Bench()
    bench.ppi.start(bench.target)
    bench.run(BLANK + 2 * LINE)
    bench.lines.alive = False
    bench.lines.on_change()
    assert bench.run(10 * FRAME) == []
    assert bench.ppi.busy
    bench.ppi.stop()
    assert not bench.ppi.busy
    bench.lines.alive = True
    bench.lines.on_change()
    assert bench.run(10 * FRAME) == []


def test_restart_discards_the_frame_in_progress() -> None:
    bench, other = Bench(), np.zeros((ROWS, COLUMNS), np.uint8)
    bench.ppi.start(bench.target)
    bench.run(BLANK + 2 * LINE)
    bench.ppi.start(other)
    assert bench.ppi.busy
    assert [end for _, end in bench.run(3 * FRAME)] == [FrameEnd.STORED]
    assert not bench.ppi.busy
    assert (bench.target == 99).all()
    assert (other == 2).all()


def test_unrelated_change_does_not_disturb_the_frame() -> None:
    bench = Bench()
    bench.ppi.start(bench.target)
    for _ in range(9):
        bench.run(17)
        bench.lines.on_change()
    assert [end for _, end in bench.run(FRAME)] == [FrameEnd.STORED]
    assert (bench.target == 1).all()


@pytest.mark.parametrize("start_ms", [0, 40, 66])
def test_ppi_frame_ends_with_its_last_pixel(start_ms: int) -> None:
    sky = SkyScene([0, 0, 0, 1], mag_limit=3.0)
    bench = Bench(Mt9m001(sky, condition=replace(CONDITION, noise=False)))
    target = np.zeros((1024, 1280), np.uint8)
    bench.kernel.advance_to(start_ms * PS_PER_MS)
    bench.ppi.start(target)
    bench.kernel.advance_to(200 * PS_PER_MS)
    starts_s = (1 if start_ms < 33 else 2) * 1050 * 1524 / 48e6 + 242 / 48e6
    ends_s = starts_s + (1023 * 1524 + 1280) / 48e6
    assert bench.ends == [(pytest.approx(ends_s * PS_PER_S, abs=2), FrameEnd.STORED)]
    assert bench.ppi.stored.readout_ps == pytest.approx(starts_s * PS_PER_S)
    assert target.min() > 0


@pytest.mark.parametrize("wrong", range(ROWS))
def test_wrong_line_spoils_only_its_own_frame(wrong: int) -> None:
    """One piece of a frame has lines of another length; the frame then starts again."""
    lines = Pieces(wrong)
    bench = Bench(lines)
    bench.ppi.start(bench.target)
    assert [end for _, end in bench.run(FRAME)] == [FrameEnd.WRONG_LINES]
    lines.wrong = None
    bench.ppi.start(bench.target)
    assert [end for _, end in bench.run(FRAME)][1:] == [FrameEnd.STORED]


class Pieces(Lines):
    """Each line comes by itself; line ``wrong`` is too short."""

    def __init__(self, wrong: int | None) -> None:
        super().__init__(ROWS * LINE)
        self.wrong = wrong

    def segment_at(self, time_ps: int) -> StreamSegment | None:
        whole = super().segment_at(time_ps)
        if whole is None or not whole.vsync:
            return whole
        row = (time_ps - int(whole.start_ps)) // (LINE * PERIOD)
        start = whole.start_ps + row * LINE * PERIOD
        pixels = np.ones((1, COLUMNS - (row == self.wrong)), np.uint8)
        return StreamSegment(start, LINE, 1, 1, lambda: pixels)
