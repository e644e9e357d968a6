"""The MT9M001 image sensor of AraMiS: registers on its two-wire bus, frames on its pixel lines.

MT9M001 data sheet, revisions C and K: frame timing (tables 3 and 4), electronic rolling shutter.
Assumptions where it is silent:

- PIXCLK runs while the part has power and is out of reset, on a fixed grid from that time.
- The read-out starts one exposure and a row after it is enabled, so the first frame is valid.
- A frame uses the settings at the time when FRAME_VALID rises. After a change of window, blanking
  or exposure the next frame starts one whole exposure after both the change and the last frame:
  frames of mixed exposure are not sent.
- Stopping, restarting and resetting end the output immediately.
- Pixels of a window outside the active array are black.
"""

from collections import deque
from dataclasses import dataclass
from functools import partial

from cubestack.emulator.camera.common.image_sensor import PixelClock, StarSensor, StreamSegment
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyCondition, SkyView
from cubestack.emulator.camera.mt9m001.imager import Mt9m001Imager, NoiseTerms
from cubestack.emulator.camera.mt9m001.lens import CONDITION
from cubestack.emulator.camera.mt9m001.registers import SensorSettings, read_settings, write_word
from cubestack.emulator.light.pixels import Grey
from cubestack.emulator.scene.sky import Scene
from cubestack.firmware_model.interface.cameras import mt9m001 as chip

IDLE_CLOCKS = 4_800_000
"""Length of the segments of blanking while the sensor is stopped."""

REMEMBERED = 8
"""Number of stored frames, more than any caller needs."""


@dataclass(frozen=True)
class _Frame:
    """One frame."""

    first: int  # number of the clock edge at which FRAME_VALID rises
    settings: SensorSettings
    shutter: RollingShutter  # exposure of its rows; row 0 is the window's first

    @property
    def valid_until(self) -> int:
        """Edge at which FRAME_VALID falls."""
        return self.first + self.settings.rows * self.settings.row_clocks


class Mt9m001(StarSensor):
    """One sensor, powered from time 0 on.

    Attributes:
        active_columns: pixel clocks per line with LINE_VALID high, in the latest segment.
        line_clocks: pixel clocks per line, in the latest segment.
    """

    columns, rows, word_bytes = chip.COLUMNS, chip.ROWS, 2

    def __init__(
        self,
        scene: Scene | SkyView,
        *,
        condition: SkyCondition = CONDITION,
        seed: int = 0,
        clock_hz: int = chip.PIXEL_CLOCK_HZ,
        noise: NoiseTerms | None = None,
    ) -> None:
        """Power up with the reset pin high; see ``ImageSensor``.

        Args:
            scene, condition: as for ``ImageSensor``.
            seed: seed of the part's hot pixels.
            clock_hz: master clock; PIXCLK has the same frequency.
            noise: terms of the noise in a condition with noise; default all.
        """
        super().__init__(scene, condition, chip.REGISTERS, clock_hz)
        self._imager = Mt9m001Imager(seed, noise)
        self._settings = read_settings(self._registers)
        self._since = 0  # edge of the last start or change, where the exposure begins
        self._frames: deque[_Frame] = deque(maxlen=REMEMBERED)
        self.active_columns = chip.COLUMNS
        self.line_clocks = self._settings.row_clocks

    @property
    def enabled(self) -> bool:
        return self.running and self._settings.enabled

    def _on_restart(self, now_ps: int) -> None:
        self._settings = read_settings(self._registers)
        self._frames.clear()
        self._since = 0

    def _write(self, words: list[int], now_ps: int) -> None:
        clock = self._clock
        assert clock is not None
        self._plan(clock, now_ps)
        restart = False
        for word in words:
            restart |= write_word(self._registers, word)
        before, self._settings = self._settings, read_settings(self._registers, self._settings)
        if before == self._settings and not restart:
            return
        edge = clock.first_edge(now_ps)
        begins = restart or before.enabled != self._settings.enabled
        if begins:
            self._frames.clear()
        if begins or before.timing != self._settings.timing:
            self._since = edge
        while self._frames and self._frames[-1].first >= edge:
            self._frames.pop()
        self.on_change()

    # --- pixel lines ----------------------------------------------------------------------------

    def segment_at(self, time_ps: int) -> StreamSegment | None:
        """The segment at ``time_ps``, from the last change on; None without a clock.

        ``vsync`` is FRAME_VALID, and LINE_VALID is high in a line's active columns. The last line
        of a frame is a separate segment, because FRAME_VALID falls before the end of its blanking.
        """
        clock = self._clock
        if clock is None:
            return None
        if not self._settings.enabled:
            edge = max(0, clock.first_edge(time_ps + 1) - 1)
            first = self._since + max(0, edge - self._since) // IDLE_CLOCKS * IDLE_CLOCKS
            return StreamSegment(clock.edge_ps(first), IDLE_CLOCKS, 0, 0, None)
        self._plan(clock, time_ps)
        upcoming = self._next(clock)
        if not self._frames:
            return self._blanking(clock, self._since, upcoming.first)
        frame = self._frames[-1]
        first, row_clocks = frame.first, frame.settings.row_clocks
        before_last = frame.settings.rows - 1
        # Rows and clocks of each part of a frame while FRAME_VALID is high.
        for rows, clocks in (
            (0, chip.FRAME_START_CLOCKS),
            (before_last, before_last * row_clocks),
            (1, row_clocks - chip.FRAME_START_CLOCKS),
        ):
            if clock.end_ps(first, clocks) > time_ps:
                self.active_columns = frame.settings.columns
                self.line_clocks = row_clocks
                pixels = partial(self._pixels, frame, last=rows == 1) if rows else None
                return StreamSegment(clock.edge_ps(first), clocks, 1, rows, pixels)
            first += clocks
        return self._blanking(clock, first, upcoming.first)

    def frame_from(self, time_ps: int) -> RollingShutter | None:
        """Exposure of the first frame whose read-out starts at ``time_ps`` or later.

        None while no frames are sent; only the latest ``REMEMBERED`` frames are stored.
        """
        clock = self._clock
        if clock is None or not self._settings.enabled:
            return None
        self._plan(clock, time_ps)
        later = (f.shutter for f in self._frames if f.shutter.readout_ps >= time_ps)
        return next(later, self._next(clock).shutter)

    @staticmethod
    def _blanking(clock: PixelClock, first: int, end: int) -> StreamSegment:
        return StreamSegment(clock.edge_ps(first), end - first, 0, 0, None)

    def _plan(self, clock: PixelClock, time_ps: int) -> None:
        """Create all frames that have begun by ``time_ps``."""
        if not self._settings.enabled:
            return
        while True:
            frame = self._next(clock)
            # A consumer that counts from an earlier edge may be up to 1 ps early.
            if clock.edge_ps(frame.first) > time_ps + 1:
                return
            self._frames.append(frame)

    def _next(self, clock: PixelClock) -> _Frame:
        settings = self._settings
        rows = max(settings.blank_rows, settings.exposure_rows + 1)
        first = self._since + rows * settings.row_clocks
        if self._frames:
            last = self._frames[-1]
            if last.settings.timing == settings.timing:
                first = last.first + settings.frame_rows * settings.row_clocks
            else:
                first += max(0, last.valid_until - self._since)
        row_0 = clock.edge_ps(first + chip.FRAME_START_CLOCKS)
        exposure = settings.exposure_rows
        shutter = RollingShutter(row_0, settings.row_clocks * self.period, exposure, exposure)
        return _Frame(first, settings, shutter)

    def _pixels(self, frame: _Frame, *, last: bool) -> Grey:
        """The last row of ``frame``, or all other rows."""
        render = self._imager.render
        image = self._cached(
            frame, lambda: render(self.scene, self.condition, frame.shutter, frame.settings)
        )
        return image[-1:] if last else image[:-1]
