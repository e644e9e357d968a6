"""The MLX75412 image sensor: registers on its control bus, frames on its pixel lines.

CubeStar thesis, appendices C and D. Assumptions where it is silent:

- PIXCLK runs while the part has power and its reset pin is high, on a fixed grid from that time.
  While the part is disabled, HSync, VSync and data are low.
- Enabling immediately starts the read-out of a frame with an undefined exposure. VSync stays high
  between it and the first valid frame, which explains the published split images; before all later
  frames, VSync is low during the whole vertical blanking.
- Disabling ends the output immediately.
- Frame length and the next frame's exposure are latched when a frame's read-out starts.
- Synchronised values become active with the write of the sync register.
"""

from collections import deque
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from cubestack.emulator.camera.common.image_sensor import PixelClock, StarSensor, StreamSegment
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyCondition, SkyView
from cubestack.emulator.camera.mlx75412.imager import Corrections, imager_of
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.camera.mlx75412.remap import Remap
from cubestack.emulator.light.pixels import Grey
from cubestack.emulator.scene.sky import Scene
from cubestack.firmware_model.interface.cameras import mlx75412 as chip

IDLE_CLOCKS = 4096 * chip.LINE_CLOCKS
"""Length of the segments of blanking while the sensor is disabled."""

REMEMBERED = 8
"""Number of stored spans and frames, more than any caller needs."""

MOST_FRAME_LINES = 4095
FEWEST_FRAME_LINES = chip.ROWS + 8
"""Shortest vertical blanking: assumed, far below that at 30 frames per second."""

_ENABLE = chip.REGISTERS["MODE_SELECT"].field("ENABLE")


@dataclass(frozen=True)
class _Frame:
    """Values that were latched when a frame's read-out started."""

    number: int  # since the sensor was enabled; 0 is the undefined one
    shutter: RollingShutter
    corrections: Corrections
    lines: int  # to the next frame
    next_exposure: int


@dataclass(frozen=True)
class _Span:
    """A part of the output, in numbers of clock edges."""

    first: int
    clocks: int
    vsync: int
    frame: _Frame | None = None  # the frame in read-out, or before the blanking
    rows: int = 0
    cut: bool = False  # ended early by a change; not returned again

    @property
    def end(self) -> int:
        return self.first + self.clocks


class Mlx75412(StarSensor):
    """One sensor, powered from time 0 on."""

    columns, rows, word_bytes = chip.COLUMNS, chip.ROWS, 1
    line_clocks = chip.LINE_CLOCKS
    active_columns = chip.COLUMNS

    def __init__(
        self,
        scene: Scene | SkyView,
        *,
        condition: SkyCondition = CONDITION,
        seed: int = 0,
        crystal_hz: int = chip.CRYSTAL_HZ,
        vsync_before_first_frame: bool = False,
    ) -> None:
        """Power up with the reset pin high; see ``ImageSensor``.

        Args:
            scene, condition: as for ``ImageSensor``.
            seed: seed of the part's defects and of the undefined exposures.
            crystal_hz: input clock; PIXCLK has the same frequency.
            vsync_before_first_frame: whether VSync goes low between the undefined and the first
                valid frame.
        """
        super().__init__(scene, condition, chip.REGISTERS, crystal_hz)
        self._seed = seed
        self._vsync_before_first_frame = vsync_before_first_frame
        #: what it does to a pixel while histogram remap and AutoView are both on
        self.remap = Remap.UPPER_BITS
        self._imager = imager_of(seed)
        self._enables = 0
        self._spans: deque[_Span] = deque(maxlen=REMEMBERED)
        self._frames: deque[_Frame] = deque(maxlen=REMEMBERED)

    @property
    def enabled(self) -> bool:
        return self.running and bool(_ENABLE.of(self._registers.active("MODE_SELECT")))

    def _on_restart(self, now_ps: int) -> None:
        self._spans.clear()
        self._forget_frames(now_ps)

    def _write(self, words: list[int], now_ps: int) -> None:
        was_enabled, stale = self.enabled, False
        for byte in words:
            register = self._registers.write(byte)
            if register is chip.REGISTERS["SYNC"]:
                self._registers.store("SYNC", 0)
                if byte == chip.SYNC_APPLY:
                    self._registers.sync()
                    stale = True
        if self.enabled != was_enabled or stale:
            self._replan(now_ps, cut=self.enabled != was_enabled)

    # --- pixel lines ----------------------------------------------------------------------------

    def segment_at(self, time_ps: int) -> StreamSegment | None:
        """The segment at ``time_ps``, from the last change on; None without a clock."""
        clock = self._clock
        if clock is None:
            return None
        if not self._spans:
            self._append(_Span(0, IDLE_CLOCKS, vsync=0))
        while (last := self._spans[-1]).cut or clock.end_ps(last.first, last.clocks) <= time_ps:
            self._append(self._next_span(clock, last))
        span = next(
            s for s in self._spans if not s.cut and clock.end_ps(s.first, s.clocks) > time_ps
        )
        pixels = partial(self._image, span.frame) if span.rows and span.frame else None
        return StreamSegment(clock.edge_ps(span.first), span.clocks, span.vsync, span.rows, pixels)

    def frame_from(self, time_ps: int) -> RollingShutter | None:
        """Exposure of the first frame whose read-out starts at ``time_ps`` or later.

        None if it is not planned yet; only the latest ``REMEMBERED`` frames are stored.
        """
        if self._clock is not None:
            self.segment_at(time_ps)
        later = (f.shutter for f in self._frames if f.shutter.readout_ps >= time_ps)
        return next(later, None)

    def _append(self, span: _Span) -> None:
        self._spans.append(span)
        if span.rows and span.frame is not None:
            self._frames.append(span.frame)

    def _next_span(self, clock: PixelClock, last: _Span) -> _Span:
        if not self.enabled:
            return _Span(last.end, IDLE_CLOCKS, vsync=0)
        if last.frame is None or last.cut:
            return self._read_out(clock, last.end, None)
        if not last.rows:
            return self._read_out(clock, last.end, last.frame)
        undefined = last.frame.number == 0
        vsync = int(undefined and not self._vsync_before_first_frame)
        clocks = (last.frame.lines - chip.ROWS) * chip.LINE_CLOCKS
        return _Span(last.end, clocks, vsync, last.frame)

    def _read_out(self, clock: PixelClock, first: int, before: _Frame | None) -> _Span:
        """The read-out of the frame after ``before``, or of the undefined one."""
        active = self._registers.active
        lines = frame_lines(active("CLOCKS_PER_SECOND"), active("FRAMES_PER_SECOND"))
        programmed = exposure_lines(active("EXPOSURE_RULE"), active("EXPOSURE"), lines)
        if before is None:
            generator = np.random.default_rng([self._seed, 0xF125, self._enables])
            exposure, wanted = int(generator.integers(1, lines)), programmed
        else:
            exposure = wanted = before.next_exposure
        shutter = RollingShutter(
            clock.edge_ps(first), chip.LINE_CLOCKS * self.period, exposure, programmed_lines=wanted
        )
        number = 0 if before is None else before.number + 1
        frame = _Frame(number, shutter, self._corrections(), lines, next_exposure=programmed)
        return _Span(first, chip.ROWS * chip.LINE_CLOCKS, 1, frame, chip.ROWS)

    def _corrections(self) -> Corrections:
        value = self._registers.active("HARDWARE_FEATURES")

        def on(name: str) -> bool:
            return bool(chip.REGISTERS["HARDWARE_FEATURES"].field(name).of(value))

        viewed = chip.REGISTERS["FIRMWARE_FEATURES"].field("AUTOVIEW")
        remapped = on("HISTOGRAM_REMAP") and viewed.of(self._registers.active("FIRMWARE_FEATURES"))
        return Corrections(
            on("DEFECT_CORRECTION"),
            on("FPN_CORRECTION"),
            on("DARK_SUBTRACTION"),
            self.remap if remapped else Remap.UPPER_BITS,
        )

    def _replan(self, now_ps: int, *, cut: bool) -> None:
        """Drop the spans from ``now_ps`` on; with ``cut``, end the present one too."""
        clock = self._clock
        assert clock is not None
        self.segment_at(now_ps)
        edge = clock.first_edge(now_ps)
        while self._spans[-1].first >= edge and len(self._spans) > 1:
            self._spans.pop()
        self._forget_frames(now_ps)
        last = self._spans[-1]
        if last.first > edge:
            raise ValueError(
                f"the sensor can not change at {now_ps} ps: its output is already planned up to "
                f"{clock.edge_ps(last.first)} ps"
            )
        if cut:
            self._enables += self.enabled
            self._spans[-1] = replace(last, clocks=edge - last.first, cut=True)
        self.on_change()

    def _forget_frames(self, now_ps: int) -> None:
        while self._frames and self._frames[-1].shutter.readout_ps >= now_ps:
            self._frames.pop()

    def _image(self, frame: _Frame) -> Grey:
        render = self._imager.render
        return self._cached(
            frame, lambda: render(self.scene, self.condition, frame.shutter, frame.corrections)
        )


def frame_lines(clocks_per_second: int, frames_per_second: int) -> int:
    """Line times from one frame to the next, rounded to the nearest (assumed), within the limits.

    A line is 1322 input clocks, and the lowest frame rate, one frame in 5 413 590 of them, is 4095
    lines, so a frame is a whole number of lines (appendix C: eq. C.0.1, figure C.1; table D.2).
    ``clocks_per_second`` is the value in the registers, which may differ from the crystal.
    """
    if frames_per_second == 0:
        return MOST_FRAME_LINES
    clocks = 2 * frames_per_second * chip.LINE_CLOCKS
    nearest = (2 * clocks_per_second + clocks // 2) // clocks
    return min(max(nearest, FEWEST_FRAME_LINES), MOST_FRAME_LINES)


def exposure_lines(rule: int, exposure: int, lines: int) -> int:
    """Exposure in line times for a frame of ``lines``, from EXPOSURE_RULE and EXPOSURE."""
    if rule == chip.LONGEST_EXPOSURE:
        return lines - 1
    return min(max(exposure, 1), lines - 1)
