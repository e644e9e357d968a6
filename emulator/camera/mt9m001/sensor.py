"""The MT9M001 image sensor of AraMiS: registers on its two-wire bus, frames on its pixel lines.

MT9M001 data sheet, revisions C and K: frame timing (tables 3 and 4), electronic rolling shutter.
What it leaves open, we take:

- PIXCLK runs whenever the part has power and is out of reset, on a fixed grid from then on.
- The read-out starts one exposure and a row after it is enabled, so that the first frame is good.
- A frame keeps the settings that hold when FRAME_VALID rises. After a change of window, blanking
  or exposure the next frame starts one whole exposure after both the change and the last frame:
  frames of mixed exposure are not sent.
- Stopping, restarting and resetting end the output in the middle of whatever it was.
- Pixels of a window beyond the active array are black.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.stream import PixelClock, StreamSegment
from cubestack.emulator.camera.mt9m001.imager import Mt9m001Imager
from cubestack.emulator.camera.mt9m001.noise import NoiseTerms
from cubestack.emulator.camera.mt9m001.registers import SensorSettings, read_settings, write_word
from cubestack.emulator.scene.sky import Scene, SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.interface.cameras.mt9m001 import (
    COLUMNS,
    FRAME_START_CLOCKS,
    PIXEL_CLOCK_HZ,
    REGISTERS,
    ROWS,
)

__all__ = ["Mt9m001"]

IDLE_CLOCKS = 4_800_000
"""Length in which the endless blanking of the stopped sensor is handed out."""

REMEMBERED = 8
"""Frames kept: more than anybody looks back."""


@dataclass(frozen=True)
class _Frame:
    """One frame.

    Attributes:
        first: number of the clock edge at which FRAME_VALID rises.
        settings: what holds for it.
        shutter: exposure of its rows; row 0 is the window's first.
    """

    first: int
    settings: SensorSettings
    shutter: RollingShutter

    @property
    def valid_until(self) -> int:
        """Edge at which FRAME_VALID falls."""
        return self.first + self.settings.rows * self.settings.row_clocks


class Mt9m001:
    """One sensor, powered from time 0 on.

    Attributes:
        active_columns: pixel clocks with LINE_VALID high, in the segment handed out last.
        line_clocks: pixel clocks of a line, in the segment handed out last.
        on_change: called after the output from now on has become another than announced.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        seed: int = 0,
        clock_hz: int = PIXEL_CLOCK_HZ,
        noise: NoiseTerms | None = None,
        background_electrons_per_s: float | None = None,
    ) -> None:
        """Power up with the reset pin high.

        Args:
            scene: what it looks at; ValueError when its lens is that of another sensor.
            seed: of the part's hot pixels.
            clock_hz: master clock; PIXCLK has the same frequency.
            noise: which terms of noise there are in a scene that wants noise, all unless given.
            background_electrons_per_s: light from elsewhere in each pixel.
        """
        self.on_change: Callable[[], None] = lambda: None
        self._imager = Mt9m001Imager(seed, noise or NoiseTerms(), background_electrons_per_s)
        self._hz = clock_hz
        self._registers = RegisterFile(REGISTERS)
        self._settings = read_settings(self._registers)
        self._clock: PixelClock | None = PixelClock(clock_hz)
        self._powered = True
        self._reset_pin = 1
        self._since = 0  # edge of the last start or change: exposing anew begins there
        self._frames: deque[_Frame] = deque(maxlen=REMEMBERED)
        self._rendered: tuple[_Frame, Scene, NDArray[np.uint8]] | None = None
        self.scene = scene
        self.active_columns = COLUMNS
        self.line_clocks = self._settings.row_clocks

    @property
    def scene(self) -> Scene:
        """What it looks at; a new one is seen by the next frame that is rendered."""
        return self._scene

    @scene.setter
    def scene(self, scene: Scene) -> None:
        if isinstance(scene, SkyScene):
            size = scene.optics.columns, scene.optics.rows
        else:
            size = scene.size
        if size != (COLUMNS, ROWS):
            raise ValueError(
                f"the MT9M001 has {COLUMNS} x {ROWS} pixels, the scene's sensor {size}"
            )
        self._scene = scene

    @property
    def period(self) -> Fraction:
        """Time of one pixel clock in ps."""
        return Fraction(PS_PER_S, self._hz)

    @property
    def running(self) -> bool:
        """Whether the part has power and is out of reset."""
        return self._clock is not None

    @property
    def enabled(self) -> bool:
        """Whether it sends frames."""
        return self.running and self._settings.enabled

    @property
    def temperature_c(self) -> float:
        """Temperature of the sensor, in degrees Celsius."""
        return self._scene.temperature_c

    # --- supply and reset -----------------------------------------------------------------------

    def power(self, on: bool, now_ps: int) -> None:
        """Turn the supply on or off."""
        self._powered = on
        self._start_or_stop(now_ps)

    def set_reset_pin(self, level: int, now_ps: int) -> None:
        """Drive the reset pin, low active."""
        self._reset_pin = level
        self._start_or_stop(now_ps)

    def _start_or_stop(self, now_ps: int) -> None:
        run = self._powered and bool(self._reset_pin)
        if run == self.running:
            return
        self._registers.reset()
        self._settings = read_settings(self._registers)
        self._clock = PixelClock(self._hz, now_ps) if run else None
        self._frames.clear()
        self._since = 0
        self.on_change()

    # --- control bus ----------------------------------------------------------------------------

    def i2c_write(self, address: int, data: bytes, now_ps: int) -> bool:
        """A write message to the 7-bit ``address`` ended; returns whether it was acknowledged.

        One byte of register address, then 16 bits for that register and those that follow, upper
        byte first; half a word is dropped.
        """
        clock = self._clock
        if clock is None or address != REGISTERS.i2c_address:
            return False
        if not data:
            return True
        self._plan(clock, now_ps)
        self._registers.select(data[0])
        restart = False
        for upper, lower in zip(data[1::2], data[2::2], strict=False):
            restart |= write_word(self._registers, upper << 8 | lower)
        before, self._settings = self._settings, read_settings(self._registers, self._settings)
        if before == self._settings and not restart:
            return True
        edge = clock.first_edge(now_ps)
        begins = restart or before.enabled != self._settings.enabled
        if begins:
            self._frames.clear()
        if begins or before.timing != self._settings.timing:
            self._since = edge
        while self._frames and self._frames[-1].first >= edge:
            self._frames.pop()
        self.on_change()
        return True

    def i2c_read(self, address: int, count: int, now_ps: int) -> bytes | None:
        """Read ``count`` bytes from the last register address on; None if not acknowledged."""
        del now_ps
        if not self.running or address != REGISTERS.i2c_address:
            return None
        words = b"".join(self._registers.read().to_bytes(2, "big") for _ in range(-(-count // 2)))
        return words[:count]

    # --- pixel lines ----------------------------------------------------------------------------

    def segment_at(self, time_ps: int) -> StreamSegment | None:
        """The stretch of output at ``time_ps``, not before the last change; None without clock.

        ``vsync`` is FRAME_VALID, and LINE_VALID is high in a line's active columns. The last line
        of a frame is a segment of its own, because FRAME_VALID falls before a whole line is over.
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
        first = frame.first
        for rows, clocks in self._parts(frame.settings):
            start = clock.edge_ps(first)
            # Where a consumer that counts from the first edge sees the end.
            if start + clocks * PS_PER_S // self._hz > time_ps:
                self.active_columns = frame.settings.columns
                self.line_clocks = frame.settings.row_clocks
                pixels = self._renderer(frame, last=rows == 1) if rows else None
                return StreamSegment(start, clocks, 1, rows, pixels)
            first += clocks
        return self._blanking(clock, first, upcoming.first)

    def frame_from(self, time_ps: int) -> RollingShutter | None:
        """Exposure of the first frame whose read-out starts at ``time_ps`` or later.

        None when no frame is to be expected; of long ago, only the last frames are known.
        """
        clock = self._clock
        if clock is None or not self._settings.enabled:
            return None
        self._plan(clock, time_ps)
        later = (f.shutter for f in self._frames if f.shutter.readout_ps >= time_ps)
        return next(later, self._next(clock).shutter)

    def _blanking(self, clock: PixelClock, first: int, end: int) -> StreamSegment:
        return StreamSegment(clock.edge_ps(first), end - first, 0, 0, None)

    @staticmethod
    def _parts(settings: SensorSettings) -> tuple[tuple[int, int], ...]:
        """Rows and clocks of each part of a frame while FRAME_VALID is high."""
        before_last = settings.rows - 1
        after_last = settings.row_clocks - FRAME_START_CLOCKS
        return (
            (0, FRAME_START_CLOCKS),
            (before_last, before_last * settings.row_clocks),
            (1, after_last),
        )

    def _plan(self, clock: PixelClock, time_ps: int) -> None:
        """Make all frames that have begun by ``time_ps``."""
        if not self._settings.enabled:
            return
        while True:
            frame = self._next(clock)
            # A consumer that counts from an earlier edge may ask up to 1 ps before this one.
            if clock.edge_ps(frame.first) > time_ps + 1:
                return
            self._frames.append(frame)

    def _next(self, clock: PixelClock) -> _Frame:
        """The frame after the last one that was made."""
        settings = self._settings
        first = self._since + max(settings.blank_rows, settings.exposure_rows + 1) * (
            settings.row_clocks
        )
        if self._frames:
            last = self._frames[-1]
            if last.settings.timing == settings.timing:
                first = last.first + settings.frame_rows * settings.row_clocks
            else:
                first += max(0, last.valid_until - self._since)
        row_0 = clock.edge_ps(first + FRAME_START_CLOCKS)
        exposure = settings.exposure_rows
        shutter = RollingShutter(row_0, settings.row_clocks * self.period, exposure, exposure)
        return _Frame(first, settings, shutter)

    def _renderer(self, frame: _Frame, *, last: bool) -> Callable[[], NDArray[np.uint8]]:
        def render() -> NDArray[np.uint8]:
            if self._rendered is None or self._rendered[:2] != (frame, self._scene):
                picture = self._imager.picture(self._scene, frame.shutter, frame.settings)
                self._rendered = frame, self._scene, picture
            picture = self._rendered[2]
            return picture[-1:] if last else picture[:-1]

        return render
