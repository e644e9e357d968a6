"""The program's use of the camera unit: set-up, start and stop, images by DMA.

AraMiS thesis, sections 2.4 and 2.5.2; registers are those of the sensor's own table. The camera
sends frames continuously while the star tracker is active; an image is the next whole frame.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.hardware import PICTURES_AT, AramisHardware, FrameEnd
from cubestack.firmware_model.aramis.state import State
from cubestack.firmware_model.interface.aramis import IMAGE_BYTES, Reason
from cubestack.firmware_model.interface.cameras import mt9m001
from cubestack.firmware_model.interface.cameras.mt9m001 import COLUMNS, REGISTERS, ROWS
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import CameraTransfer, ReadTimer, Routine, Sleep, pause

SETTLE_US = 2_000  #: from power-up to the first register access; assumed
ROW_CLOCKS = COLUMNS + mt9m001.FRAME_START_CLOCKS + mt9m001.FRAME_END_CLOCKS
BLANK_ROWS = REGISTERS["VERTICAL_BLANKING"].reset + 1
MARGIN_US = 20_000  #: added to three frames in the time-out of an image; assumed

_ENABLE = REGISTERS["OUTPUT_CONTROL"].field("CHIP_ENABLE").mask


@dataclass
class Camera:
    """Registers over the control bus, and images; set up with the settings in the state."""

    _hardware: AramisHardware
    _state: State
    _meter: Meter
    #: address and value of the register read last; value None: no answer
    selected_register: tuple[int, int | None] = (0, None)
    off: bool = False  #: its supply was switched off by a latch-up action
    #: which of the two places holds the latest image; None before the first
    latest: int | None = None
    _set_up: tuple[int, int] | None = None
    _pending: int | None = None
    _ended: tuple[FrameEnd, int] | None = None
    _exposure_rows: int = 0  # of the awaited frame

    def frame_ended(self, end: FrameEnd) -> None:
        self._meter.charge(frame_interrupt=1)
        self._ended = end, self._hardware.uptime_us()
        self._hardware.wake()

    def cut(self) -> None:
        """Interrupt: turn the supply off at once."""
        self._give_up()
        self._hardware.switch_camera(False)
        self.off = True
        self._set_up = None
        self._hardware.wake()

    def restore(self) -> Routine[None]:
        """Turn the supply on and wait until the sensor is ready, at its reset values."""
        self._hardware.switch_camera(True)
        self.off = False
        yield from pause(SETTLE_US)

    def start(self) -> Routine[Reason | None]:
        """Start the sensor with the settings; returns the reason of a failure."""
        if self.off:
            return self._fail(Reason.CAMERA_OFF, "CameraOff")
        gain = mt9m001.gain_register(float(self._state.settings.get("SetGain", "Gain")))
        rows = int(self._state.settings.get("SetExposure", "Rows"))
        if self._set_up == (gain, rows):
            return None
        self._set_up = None
        self._give_up()
        if (yield from self._read(REGISTERS["CHIP_VERSION"].address)) != mt9m001.CHIP_VERSION:
            return self._fail(Reason.CAMERA_SILENT, "CameraSilent")
        written = {"SHUTTER_WIDTH": rows, "GLOBAL_GAIN": gain, "OUTPUT_CONTROL": _ENABLE}
        for name, value in written.items():
            if not (yield from self.write(REGISTERS[name].address, value)):
                return self._fail(Reason.CAMERA_SILENT, "CameraSilent")
        self._set_up = gain, rows
        return None

    def stop(self) -> Routine[None]:
        self._give_up()
        self._set_up = None
        if not self.off:
            yield from self.write(REGISTERS["OUTPUT_CONTROL"].address, 0)

    def _fail(self, reason: Reason, flag: str) -> Reason:
        self._state.raise_flag(flag)
        return reason

    def picture(self, place: int) -> NDArray[np.uint8]:
        """One of the two images in SDRAM, shape (1024, 1280), a live view."""
        start = PICTURES_AT[place]
        return self._hardware.sdram[start : start + IMAGE_BYTES].reshape(ROWS, COLUMNS)

    def expose(self) -> None:
        """Start the transfer of the next whole frame; the program continues meanwhile."""
        self._ended = None
        self._pending = place = 0 if self.latest is None else 1 - self.latest
        self._exposure_rows = int(self._state.settings.get("SetExposure", "Rows"))
        self._hardware.start_capture(self.picture(place))

    def _give_up(self) -> None:
        self._hardware.stop_capture()
        self._pending = None

    def take(self) -> Routine[Reason | None]:
        """Wait for the frame, after ``expose`` if needed; returns the reason of a failure."""
        if self._pending is None:
            self.expose()
        rows = max(ROWS + BLANK_ROWS, self._exposure_rows + 1)
        frame_us = -(-rows * ROW_CLOCKS * 1_000_000 // mt9m001.PIXEL_CLOCK_HZ)
        started_us: int = yield ReadTimer()
        deadline_us = started_us + 3 * frame_us + MARGIN_US
        while self._ended is None:
            if self.off:
                return self._fail(Reason.CAMERA_OFF, "CameraOff")
            now_us: int = yield ReadTimer()
            if now_us >= deadline_us:
                self._give_up()
                self._set_up = None
                return self._fail(Reason.CAMERA_TIMEOUT, "CameraTimeout")
            yield Sleep(deadline_us)
        place, self._pending = self._pending, None
        if self._ended[0] is not FrameEnd.STORED:
            self._set_up = None
            return self._fail(Reason.CAMERA_FRAME, "CameraFrameError")
        self.latest = place
        self._state.frames += 1
        return None

    def image_us(self) -> int:
        """Uptime at mid-exposure of the middle row of the latest image."""
        assert self._ended is not None
        clocks = ((ROWS - 1) / 2 + self._exposure_rows / 2) * ROW_CLOCKS + COLUMNS
        return self._ended[1] - round(clocks * 1_000_000 / mt9m001.PIXEL_CLOCK_HZ)

    def write(self, address: int, value: int) -> Routine[bool]:
        """Write a register; False if the sensor does not acknowledge."""
        return (yield CameraTransfer(bytes([address, *value.to_bytes(2, "big")]))) is not None

    def forget_set_up(self) -> None:
        """Registers were written by other means: set the sensor up again before an image."""
        self._set_up = None

    def select(self, address: int) -> Routine[None]:
        value = yield from self._read(address)
        self.selected_register = address, value
        if value is None:
            self._state.raise_flag("CameraSilent")

    def _read(self, address: int) -> Routine[int | None]:
        answer: bytes | None = yield CameraTransfer(bytes([address]), read=2)
        return None if answer is None else int.from_bytes(answer, "big")
