"""The MLX75412 image sensor: registers on its control bus, frames on its pixel lines.

CubeStar thesis, appendices C and D. What it leaves open, we take:

- PIXCLK runs whenever the part has power and its reset pin is high, on a fixed grid from then on.
  While the part is disabled, HSync, VSync and data are low.
- Enabling starts the read-out of a frame with an undefined exposure at once. No VSync low separates
  it from the first good frame, which explains the published split pictures; all later frames are
  preceded by VSync low during the whole vertical blanking.
- Disabling ends the output in the middle of whatever it was.
- Frame length and the next frame's exposure are taken over when a frame's read-out starts.
- Synchronised values become active with the write of the sync register.
"""

from collections import deque
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from cubestack.emulator.camera.common.imager import Grey
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.star_sensor import StarSensor
from cubestack.emulator.camera.common.stream import PixelClock, StreamSegment
from cubestack.emulator.camera.common.view import SkyCondition, SkyView
from cubestack.emulator.camera.mlx75412.imager import Corrections, Mlx75412Imager
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.scene.sky import Scene
from cubestack.firmware_model.interface.cameras import mlx75412 as chip

IDLE_CLOCKS = 4096 * chip.LINE_CLOCKS
"""Length in which the endless blanking of the disabled sensor is handed out."""

REMEMBERED = 8
"""Spans and frames kept: more than anybody looks ahead or back."""

MOST_FRAME_LINES = 4095
FEWEST_FRAME_LINES = chip.ROWS + 8
"""Shortest vertical blanking: assumed, far below what 30 frames a second leave."""

_ENABLE = chip.REGISTERS["MODE_SELECT"].field("ENABLE")


@dataclass(frozen=True)
class _Frame:
    """What was settled when a frame's read-out started."""

    number: int  # since the sensor was enabled; 0 is the undefined one
    shutter: RollingShutter
    corrections: Corrections
    lines: int  # to the next frame
    next_exposure: int


@dataclass(frozen=True)
class _Span:
    """A stretch of output, in numbers of clock edges."""

    first: int
    clocks: int
    vsync: int
    frame: _Frame | None = None  # that is read out, or that the blanking follows
    rows: int = 0
    cut: bool = False  # ended early by a change; never handed out again

    @property
    def end(self) -> int:
        return self.first + self.clocks


class Mlx75412(StarSensor):
    """One sensor, powered from time 0 on.

    Attributes:
        line_clocks: pixel clocks of a line.
        active_columns: those of them with HSync high.
    """

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
            scene, condition: as of there.
            seed: of the part's defects and of the undefined exposures.
            crystal_hz: input clock; PIXCLK has the same frequency.
            vsync_before_first_frame: whether VSync goes low between the undefined and the first
                good frame.
        """
        super().__init__(scene, condition, chip.REGISTERS, crystal_hz)
        self._seed = seed
        self._vsync_before_first_frame = vsync_before_first_frame
        self._imager = Mlx75412Imager(seed)
        self._enables = 0
        self._spans: deque[_Span] = deque(maxlen=REMEMBERED)
        self._frames: deque[_Frame] = deque(maxlen=REMEMBERED)

    @property
    def enabled(self) -> bool:
        """Whether it gathers images."""
        return self.running and bool(_ENABLE.of(self._registers.active("MODE_SELECT")))

    def _restarted(self, now_ps: int) -> None:
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
        """The stretch of output at ``time_ps``, not before the last change; None without clock."""
        clock = self._clock
        if clock is None:
            return None
        if not self._spans:
            self._append(_Span(0, IDLE_CLOCKS, vsync=0))
        while (last := self._spans[-1]).cut or clock.end_ps(last.first, last.clocks) <= time_ps:
            self._append(self._after(clock, last))
        span = next(
            s for s in self._spans if not s.cut and clock.end_ps(s.first, s.clocks) > time_ps
        )
        pixels = partial(self._picture, span.frame) if span.rows and span.frame else None
        return StreamSegment(clock.edge_ps(span.first), span.clocks, span.vsync, span.rows, pixels)

    def frame_from(self, time_ps: int) -> RollingShutter | None:
        """Exposure of the first frame whose read-out starts at ``time_ps`` or later.

        None when its output was not announced yet; of long ago, only the last frames are known.
        """
        if self._clock is not None:
            self.segment_at(time_ps)
        later = (f.shutter for f in self._frames if f.shutter.readout_ps >= time_ps)
        return next(later, None)

    def _append(self, span: _Span) -> None:
        self._spans.append(span)
        if span.rows and span.frame is not None:
            self._frames.append(span.frame)

    def _after(self, clock: PixelClock, last: _Span) -> _Span:
        """What follows ``last`` when nothing changes."""
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

        return Corrections(on("DEFECT_CORRECTION"), on("FPN_CORRECTION"), on("DARK_SUBTRACTION"))

    def _replan(self, now_ps: int, *, cut: bool) -> None:
        """Forget what was planned from ``now_ps`` on; with ``cut``, the present span too."""
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
                f"the sensor can not change at {now_ps} ps after its output was looked up to "
                f"{clock.edge_ps(last.first)} ps"
            )
        if cut:
            self._enables += self.enabled
            self._spans[-1] = replace(last, clocks=edge - last.first, cut=True)
        self.on_change()

    def _forget_frames(self, now_ps: int) -> None:
        while self._frames and self._frames[-1].shutter.readout_ps >= now_ps:
            self._frames.pop()

    def _picture(self, frame: _Frame) -> Grey:
        look = self._imager.picture
        return self._once(
            frame, lambda: look(self.scene, self.condition, frame.shutter, frame.corrections)
        )


def frame_lines(clocks_per_second: int, frames_per_second: int) -> int:
    """Line times from one frame to the next, the nearest whole number (assumed) in range.

    A line is 1322 input clocks, and the lowest frame rate, one frame in 5 413 590 of them, is 4095
    lines: so a frame is a whole number of lines (appendix C: eq. C.0.1, figure C.1; table D.2).
    ``clocks_per_second`` is what the registers assume, whatever crystal there is.
    """
    if frames_per_second == 0:
        return MOST_FRAME_LINES
    clocks = 2 * frames_per_second * chip.LINE_CLOCKS
    nearest = (2 * clocks_per_second + clocks // 2) // clocks
    return min(max(nearest, FEWEST_FRAME_LINES), MOST_FRAME_LINES)


def exposure_lines(rule: int, exposure: int, lines: int) -> int:
    """Line times of exposure within a frame of ``lines``, by EXPOSURE_RULE and EXPOSURE."""
    if rule == chip.LONGEST_EXPOSURE:
        return lines - 1
    return min(max(exposure, 1), lines - 1)
