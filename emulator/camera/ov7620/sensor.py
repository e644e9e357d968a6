"""The OV7620 image sensor: registers on its two control lines, frames on its pixel lines.

CubeSense thesis, sections 3.2 and 6.4.1 and appendix A; OV7620 product specifications, section
1.13. A frame has 525 lines of 858 clocks at 13.5 MHz. Assumptions where the sources are silent:

- PCLK runs while the part has power, on a fixed grid, and frames follow each other from that time.
  A frame begins with blanking; VSYN is high in all blanking between frames.
- HREF rises with a line's first clock, wherever the window begins. The window's rows keep their
  places in the frame. The window is limited to 640 x 480 pixels, at least 4 x 2: the rest of the
  664 x 492 pixels is never sent.
- Register values take effect with the next frame; the exposure one frame later, as its rows are
  exposed during the read-out of the frame before.
- Automatic exposure and gain adjust at once to a mean level of the image.
- Without black-and-white mode, Y is the mean of two rows.
"""

import math
from collections import OrderedDict
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from cubestack.emulator.camera.common.hazards import effects
from cubestack.emulator.camera.common.hazards.contract import Exposure, Lens
from cubestack.emulator.camera.common.image_sensor import ImageSensor, PixelClock, StreamSegment
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.ov7620 import luminance
from cubestack.emulator.camera.ov7620.fisheye import check_field
from cubestack.emulator.camera.ov7620.lens_error import NOMINAL, LensError
from cubestack.emulator.camera.ov7620.light import blur, scene_light
from cubestack.emulator.camera.ov7620.sccb import SccbSlave
from cubestack.emulator.camera.ov7620.view import IN_FOCUS, EarthSunView, FisheyeCondition
from cubestack.emulator.light.noise import FrameNoise
from cubestack.emulator.light.pixels import Grey, Light
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene
from cubestack.firmware_model.interface.cameras import ov7620 as chip

FRAME_CLOCKS = chip.LINES_PER_FRAME * chip.CLOCKS_PER_LINE
LINES_BEFORE = chip.LINES_PER_FRAME - chip.ROWS
"""Lines of blanking before the first row: all of the frame's."""

AUTO_LEVEL = 100.0
"""Target of automatic exposure and gain, a mean grey value: assumed."""

LONGEST_EXPOSURE, HIGHEST_GAIN = 255, 7.75  # of EXPOSURE and GAIN
SHAPE = chip.ROWS, chip.COLUMNS
REMEMBERED = 8
"""Number of stored frames, more than any caller needs."""


@dataclass(frozen=True)
class _Settings:
    """Settings from the registers when a frame begins."""

    columns: range
    rows: range
    gain: float
    exposure_lines: int
    mirror: bool
    monochrome: bool


@dataclass(frozen=True)
class _Frame:
    """One frame, counted from power-up."""

    number: int
    settings: _Settings
    shutter: RollingShutter


class Ov7620(ImageSensor[EarthSunScene, FisheyeCondition]):
    """One camera of CubeSense, powered from time 0 on.

    Attributes:
        camera: which of the two it is.
        active_columns: pixel clocks per line with HREF high, in the latest segment.
    """

    scene_types = (EarthSunScene,)
    sees = "the scene of a Sun and nadir sensor is Earth and Sun"
    line_clocks = chip.CLOCKS_PER_LINE

    def __init__(
        self,
        scene: EarthSunScene | EarthSunView,
        camera: CameraTarget,
        condition: FisheyeCondition | None = None,
        lens: LensError = NOMINAL,
    ) -> None:
        """Power up; a view's condition replaces ``condition``, and both may replace ``lens``."""
        super().__init__(
            scene, condition or FisheyeCondition(), chip.REGISTERS, chip.PIXEL_CLOCK_HZ
        )
        self.camera = camera
        self._own_lens = lens
        self.active_columns = chip.COLUMNS
        self._sccb = SccbSlave(chip.REGISTERS.i2c_address, self._write)
        self._frames: OrderedDict[int, _Frame] = OrderedDict()

    @property
    def lens(self) -> LensError:
        """Deviation of the lens: that of the condition, else the unit's, with hazards."""
        condition = self.condition
        given = condition.sun_lens if self.camera is CameraTarget.SUN else condition.nadir_lens
        own = self._own_lens if given is None else given
        basics = self._basics
        if basics.scale == 1 and not basics.residuals:
            return own
        return replace(own, scale=own.scale * basics.scale, residuals=basics.residuals)

    @property
    def _hazards(self) -> effects.Hazards:
        return tuple(replace(h, seed=h.seed ^ self.camera) for h in self.condition.hazards)

    @property
    def _basics(self) -> Lens:
        return effects.lens(IN_FOCUS, self._hazards, self.condition.temperature_c)

    def _check(self, scene: EarthSunScene, condition: FisheyeCondition) -> None:
        del condition
        for reflection in scene.reflections:
            check_field(reflection.alpha_deg, reflection.beta_deg)

    def _on_restart(self, now_ps: int) -> None:
        del now_ps
        self._sccb = SccbSlave(chip.REGISTERS.i2c_address, self._write)
        self._frames.clear()

    # --- control lines --------------------------------------------------------------------------

    @property
    def sda(self) -> int:
        return self._sccb.sda

    def on_pin(self, name: str, level: int, now_ps: int) -> None:
        """The microcontroller set SCL or SDA; ignored without power."""
        if self.running:
            self._sccb.on_pin(name, level, now_ps)

    def _write(self, address: int, value: int, now_ps: int) -> None:
        clock = self._clock
        assert clock is not None
        # The frame that has begun keeps its settings, and the next one its exposure.
        begun = self._frame(clock, max(0, clock.first_edge(now_ps + 1) - 1) // FRAME_CLOCKS)
        self._registers.select(address)
        self._registers.write(value)
        common_a = chip.REGISTERS["COMMON_A"]
        if common_a.field("RESET").of(self._registers.active("COMMON_A")):
            self._registers.reset()
        stale = [number for number in self._frames if number > begun.number]
        for number in stale:
            del self._frames[number]
        if stale:
            self.on_change()

    # --- pixel lines ----------------------------------------------------------------------------

    def segment_at(self, time_ps: int) -> StreamSegment | None:
        """The segment at ``time_ps``, from the last change on; None without a clock."""
        clock = self._clock
        if clock is None:
            return None
        number = max(0, clock.first_edge(time_ps) - 1) // FRAME_CLOCKS
        while True:
            frame = self._frame(clock, number)
            first = number * FRAME_CLOCKS
            for rows, lines in self._stretches(frame.settings):
                clocks = lines * chip.CLOCKS_PER_LINE
                if clock.end_ps(first, clocks) > time_ps:
                    self.active_columns = len(frame.settings.columns)
                    pixels = partial(self._pixels, frame) if rows else None
                    return StreamSegment(clock.edge_ps(first), clocks, int(not rows), rows, pixels)
                first += clocks
            number += 1

    def frame_from(self, time_ps: int) -> RollingShutter:
        """Exposure of the first frame whose read-out starts at ``time_ps`` or later.

        The part must have power; only the latest ``REMEMBERED`` frames are stored.
        """
        clock = self._clock
        assert clock is not None
        number = (
            max(0, clock.first_edge(time_ps) - LINES_BEFORE * chip.CLOCKS_PER_LINE) // FRAME_CLOCKS
        )
        while (shutter := self._frame(clock, number).shutter).readout_ps < time_ps:
            number += 1
        return shutter

    @staticmethod
    def _stretches(settings: _Settings) -> list[tuple[int, int]]:
        """Rows sent, and lines, of each part of a frame."""
        before = LINES_BEFORE + settings.rows.start
        after = chip.LINES_PER_FRAME - before - len(settings.rows)
        parts = [(0, before), (len(settings.rows), len(settings.rows)), (0, after)]
        return [(rows, lines) for rows, lines in parts if lines]

    def _frame(self, clock: PixelClock, number: int) -> _Frame:
        if number in self._frames:
            return self._frames[number]
        # The time of a row is that of its line, so row 0 counts even if it is not sent.
        readout_ps = clock.edge_ps(number * FRAME_CLOCKS + LINES_BEFORE * chip.CLOCKS_PER_LINE)
        settings = self._settings(readout_ps)
        before = self._frames.get(number - 1)
        exposure = settings.exposure_lines if before is None else before.settings.exposure_lines
        shutter = RollingShutter(readout_ps, chip.CLOCKS_PER_LINE * self.period, exposure, exposure)
        self._frames[number] = frame = _Frame(number, settings, shutter)
        while len(self._frames) > REMEMBERED:
            self._frames.popitem(last=False)
        return frame

    def _settings(self, time_ps: int) -> _Settings:
        active = self._registers.active

        def bit(register: str, field: str) -> bool:
            return bool(chip.REGISTERS[register].field(field).of(active(register)))

        exposure, gain = max(active("EXPOSURE"), 1), _gain(active("GAIN"))
        automatic = bit("COMMON_B", "AUTO_ADJUST")
        if automatic and not bit("COMMON_I", "MANUAL_EXPOSURE"):
            counts = self._target_lines(time_ps) / (chip.EXPOSURE_LINES * gain)
            exposure = round(min(max(counts, 1), LONGEST_EXPOSURE))
        if automatic and bit("COMMON_A", "AUTO_GAIN"):
            gain = self._target_lines(time_ps) / (chip.EXPOSURE_LINES * exposure)
            gain = min(max(gain, 1.0), HIGHEST_GAIN)
        return _Settings(
            _window(
                active("HSTART") - chip.window_column(0), active("HSTOP") - chip.window_column(0), 4
            ),
            _window(active("VSTART") - chip.window_row(0), active("VSTOP") - chip.window_row(0), 2),
            gain,
            chip.EXPOSURE_LINES * exposure,
            bit("COMMON_A", "MIRROR"),
            bit("COMMON_H", "BLACK_AND_WHITE"),
        )

    # --- rendering ------------------------------------------------------------------------------

    def _pixels(self, frame: _Frame) -> Grey:
        return self._cached(frame, lambda: self._render(frame))

    def _render(self, frame: _Frame) -> Grey:
        condition, settings, shutter = self.condition, frame.settings, frame.shutter
        hazards = self._hazards
        light = self._light_at(shutter.mid_exposure_ps((chip.ROWS - 1) / 2))
        light = light * np.float32(shutter.exposure_lines)
        if not settings.monochrome:
            light[:-1] = (light[:-1] + light[1:]) / 2
        # By frame time, so that the noise of a frame does not depend on which ones were rendered.
        seed = [condition.seed, self.camera, shutter.readout_ps]
        per_count = luminance.ELECTRONS_PER_GREY / settings.gain
        exposure = Exposure(
            SHAPE, luminance.PITCH_UM, shutter.exposure_s, condition.temperature_c, per_count
        )
        light = effects.disturb_light(light, hazards, exposure, seed, luminance.ELECTRONS_PER_GREY)
        variance = effects.variance(hazards, exposure) / luminance.ELECTRONS_PER_GREY**2
        noise = FrameNoise(seed) if condition.noise else None
        stuck = luminance.stuck_pixels(
            condition.seed, self.camera, condition.hot_count, condition.hot_pairs
        )
        grey = luminance.luminance(light, settings.gain, noise, stuck, variance)
        rows, columns = settings.rows, settings.columns
        window = grey[rows.start : rows.stop, columns.start : columns.stop]
        return np.ascontiguousarray(window[:, ::-1] if settings.mirror else window)

    def _light_at(self, time_ps: int) -> Light:
        if not self.scene.moves:
            time_ps = 0  # the same at all times
        # The light already contains the spot of a lens in focus.
        further = math.sqrt(max(self._basics.spot_px**2 - luminance.SPOT_PX**2, 0))
        bloom_px = self.condition.bloom_px
        return _light(self.scene, self.camera, bloom_px, time_ps, self.lens, further)

    def _target_lines(self, time_ps: int) -> float:
        """Line times of exposure at gain 1 that result in the target level."""
        mean = float(self._light_at(time_ps).mean())
        return (AUTO_LEVEL - luminance.BLACK) / max(mean, 1e-6)


@lru_cache(maxsize=8)
def _light(
    scene: EarthSunScene,
    camera: CameraTarget,
    bloom_px: float,
    time_ps: int,
    lens: LensError,
    further_px: float,
) -> Light:
    """As `scene_light`, with further blur; shared by the frames and the sensors that see it."""
    light = scene_light(scene, camera, bloom_px, time_ps, lens)
    if further_px:
        light = blur(light, further_px)
    light.flags.writeable = False
    return light


def _gain(value: int) -> float:
    """Amplification for register GAIN (OV7620 product specifications, section 1.13)."""
    register = chip.REGISTERS["GAIN"]
    fine, double, again = (register.field(f).of(value) for f in ("FINE", "DOUBLE", "DOUBLE_AGAIN"))
    return (1 + fine / 16) * (1 + double) * (1 + again)


def _window(start: int, stop: int, step: int) -> range:
    """Columns or rows sent, from the window registers minus their offset."""
    limit = chip.COLUMNS if step == 4 else chip.ROWS
    first = min(max(start * step, 0), limit - step)
    return range(first, min(max(stop * step, first + step), limit))
