"""The Blackfin's parallel peripheral interface: one frame from the pixel lines to memory, by DMA.

ADSP-BF533 Hardware Reference, chapter "Parallel Peripheral Interface" (general-purpose input with
two external syncs), AraMiS thesis, section 2.5.2: FRAME_VALID and LINE_VALID are the frame and line
syncs, PIXCLK is the clock; camera and interface are connected directly.

After its start, it waits for a rising FRAME_VALID and then reads lines. A line with more or fewer
clocks than programmed is stored as received, and reported as an error. If FRAME_VALID falls before
the last line, the frame is aborted. The memory is written at the end of the frame, as nothing reads
it before.
"""

from collections.abc import Callable, Generator
from typing import Any

import numpy as np
import simpy
from numpy.typing import NDArray

from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mt9m001.sensor import Mt9m001
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.aramis.hardware import FrameEnd


class Ppi:
    """The interface and its DMA channel.

    Attributes:
        on_end: interrupt: a frame ended.
        stored: exposure of the latest stored frame; for tests and reports.
    """

    def __init__(self, env: Kernel, camera: Mt9m001) -> None:
        """Connect to ``camera``; nothing is stored before ``start``."""
        self._env = env
        self._camera = camera
        camera.on_change = self.lines_changed
        self.on_end: Callable[[FrameEnd], None] = lambda _end: None
        self.stored: RollingShutter | None = None
        self._changed = env.event()
        self._run = 0

    @property
    def busy(self) -> bool:
        return self._run % 2 == 1

    def start(self, target: NDArray[np.uint8]) -> None:
        """Store the next whole frame in ``target`` (rows, columns); aborts the current one."""
        self.stop()
        self._run += 1
        self._env.process(self._read_frame(self._run, target))

    def stop(self) -> None:
        """Abort the current frame, without an interrupt."""
        self._run += self._run % 2
        self.lines_changed()

    def lines_changed(self) -> None:
        """Call when the camera's output changes before the end of the announced segment."""
        changed, self._changed = self._changed, self._env.event()
        changed.succeed()

    def _read_frame(self, run: int, target: NDArray[np.uint8]) -> Generator[simpy.Event, Any, None]:
        rows, columns = target.shape
        pieces: list[NDArray[np.uint8]] = []
        taken, wrong_lines, shutter = 0, False, None
        level = 1  # until it was seen low
        while run == self._run:
            segment = self._camera.segment_at(self._env.now)
            if segment is None:
                level = 0
                yield self._changed
                continue
            rose, level = segment.vsync > level, segment.vsync
            if rose:
                shutter = self._camera.frame_from(self._env.now)
                pieces, taken, wrong_lines = [], 0, False
            collecting = shutter is not None
            if collecting and not level:
                self._end(run, FrameEnd.TOO_SHORT)
                return
            lines, clocks = min(segment.rows, rows - taken) if collecting else 0, segment.clocks
            if lines and taken + lines == rows:  # until the last line's last pixel
                clocks = (lines - 1) * self._camera.line_clocks + self._camera.active_columns
            end_ps = int(segment.start_ps + clocks * self._camera.period)
            if (yield from self._wait_until(end_ps)) and lines:
                assert segment.pixels is not None
                piece = segment.pixels()[:lines]
                wrong_lines |= piece.shape[1] != columns
                pieces.append(piece)
                taken += lines
            if taken == rows and run == self._run:
                _store(pieces, target)
                self.stored = shutter
                self._end(run, FrameEnd.WRONG_LINES if wrong_lines else FrameEnd.STORED)
                return

    def _wait_until(self, end_ps: int) -> Generator[simpy.Event, Any, bool]:
        """Wait for the end of a segment; False if the lines changed before."""
        changed = self._changed
        timeout = self._env.timeout(max(0, end_ps - self._env.now))
        yield simpy.AnyOf(self._env, [timeout, changed])
        return not changed.triggered or self._env.now >= end_ps

    def _end(self, run: int, end: FrameEnd) -> None:
        if run == self._run:
            self._run += 1
            self.on_end(end)


def _store(pieces: list[NDArray[np.uint8]], target: NDArray[np.uint8]) -> None:
    row = 0
    for piece in pieces:
        width = min(target.shape[1], piece.shape[1])
        target[row : row + len(piece), :width] = piece[:, :width]
        row += len(piece)
