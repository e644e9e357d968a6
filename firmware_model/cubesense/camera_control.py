"""Cameras: their supplies, and their registers over two pins each.

CubeSense thesis, sections 3.2.1.1 and 6.4.1, appendix C.1: the program drives the serial bus itself
and only writes: start, eight bits, a ninth in which the camera may acknowledge, stop. Each line has
a pull-up; level 1 releases it. The charged cycles keep the clock below the bus' 400 kHz.

The published program sets the nadir camera's exposure once. This one sets all registers again
before the next image if a setting changed or the camera lost its supply. It cannot detect the
latter, so it assumes it for a camera that sends no image.
"""

from cubestack.firmware_model.cubesense.state import CameraSettings, State
from cubestack.firmware_model.cubesense.supply import OFF_TIME_US, Supply
from cubestack.firmware_model.interface.cameras import ov7620
from cubestack.firmware_model.interface.cubesense.codes import COLUMNS, ROWS, Camera
from cubestack.firmware_model.interface.cubesense.pins import CAMERA_POWER, CAMERA_SCL, CAMERA_SDA
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import ReadPin, ReadTimer, Routine, SetPin

START_UP_US = 2_000  #: from a camera's switch to the first write; assumed

_BLANKING_LINES = ov7620.LINES_PER_FRAME - ROWS
_SETTLE_CLOCKS = (ov7620.LINES_PER_FRAME + _BLANKING_LINES) * ov7620.CLOCKS_PER_LINE

#: From a write until the FPGA may store a frame: the current frame and the next one still have the
#: old exposure. The blanking of the latter must be over, or it would be stored.
EXPOSURE_SETTLE_US = _SETTLE_CLOCKS * 1_000_000 // ov7620.PIXEL_CLOCK_HZ + 100


def register_values(settings: CameraSettings) -> dict[str, int]:
    """Values of the camera's registers: the whole image, one byte of grey per pixel."""
    automatic, registers = settings.auto_adjust, ov7620.REGISTERS
    numbers = ("EXPOSURE", "GAIN", "BLUE_GAIN", "RED_GAIN")
    return {
        "COMMON_A": registers["COMMON_A"].value(AUTO_WHITE_BALANCE=automatic, AUTO_GAIN=automatic),
        "COMMON_B": registers["COMMON_B"].value(AUTO_ADJUST=automatic),
        "COMMON_C": registers["COMMON_C"].reset,
        "COMMON_H": registers["COMMON_H"].value(PROGRESSIVE=1, BLACK_AND_WHITE=1),
        "COMMON_I": registers["COMMON_I"].value(MANUAL_EXPOSURE=1 - automatic),
        "HSTART": ov7620.window_column(0),
        "HSTOP": ov7620.window_column(COLUMNS),
        "VSTART": ov7620.window_row(0),
        "VSTOP": ov7620.window_row(ROWS),
        **{n: min(getattr(settings, n.lower()), registers[n].bits) for n in numbers},
    }


class CameraControl:
    """Both cameras' supplies and registers; both are off at first, as at reset."""

    def __init__(self, meter: Meter, state: State, supply: Supply) -> None:
        self._meter = meter
        self._state = state
        self._supply = supply
        self._written: dict[Camera, dict[str, int] | None] = dict.fromkeys(Camera)
        self._settled_us = dict.fromkeys(Camera, 0)

    def acknowledged(self, camera: Camera) -> bool:
        """Whether ``camera`` acknowledged every byte of its latest set-up."""
        return self._written[camera] is not None

    def start(self) -> Routine[None]:
        for camera in Camera:
            yield SetPin(CAMERA_SCL[camera], 1)
            yield SetPin(CAMERA_SDA[camera], 1)
            yield SetPin(CAMERA_POWER[camera], 1)
        yield from self._supply.pause(START_UP_US)
        for camera in Camera:
            yield from self._configure(camera)

    def restart(self) -> Routine[None]:
        """Cycle both cameras' power and set them up, for telecommand Reset of the cameras."""
        for camera in Camera:
            yield SetPin(CAMERA_POWER[camera], 0)
            self._written[camera] = None
        yield from self._supply.pause(OFF_TIME_US)
        yield from self.start()

    def forget_set_up(self, camera: Camera) -> None:
        """It sent no image, so it may have lost its supply: set it up again next time."""
        self._written[camera] = None

    def prepare(self, camera: Camera) -> Routine[None]:
        """Apply the settings of ``camera`` before an image, and wait until they take effect.

        A camera that does not answer is tried once per image; the image shows whether it works.
        """
        yield from self._configure(camera)
        yield from self._supply.watch_until(self._settled_us[camera])

    def _configure(self, camera: Camera) -> Routine[None]:
        values = register_values(self._state.cameras[camera])
        self._meter.charge(i8=len(values))
        if self._written[camera] == values:
            return
        self._written[camera] = None
        for name, value in values.items():
            if not (yield from self._write(camera, ov7620.REGISTERS[name].address, value)):
                return
        now_us: int = yield ReadTimer()
        self._settled_us[camera] = now_us + EXPOSURE_SETTLE_US
        self._written[camera] = values

    def _write(self, camera: Camera, address: int, value: int) -> Routine[bool]:
        """Write one register; False if the camera did not acknowledge a byte."""
        scl, sda = CAMERA_SCL[camera], CAMERA_SDA[camera]
        self._meter.charge(call=1)
        yield SetPin(sda, 0)  # start
        self._meter.charge(i8=1)
        yield SetPin(scl, 0)
        answered = True
        for byte in (ov7620.REGISTERS.i2c_address << 1, address, value):
            answered = answered and (yield from self._send(scl, sda, byte))
        yield SetPin(sda, 0)  # stop
        self._meter.charge(i8=1, loop=1)
        yield SetPin(scl, 1)
        self._meter.charge(i8=1)
        yield SetPin(sda, 1)
        return answered

    def _send(self, scl: str, sda: str, byte: int) -> Routine[bool]:
        """Send eight bits, highest first, and read the answer; SCL is low before and after."""
        level = None
        for bit in reversed(range(8)):
            if level != byte >> bit & 1:
                level = byte >> bit & 1
                yield SetPin(sda, level)
            yield from self._clock(scl)
            yield SetPin(scl, 0)
        if not level:
            yield SetPin(sda, 1)
        yield from self._clock(scl)
        refused: int = yield ReadPin(sda)
        yield SetPin(scl, 0)
        return not refused

    def _clock(self, scl: str) -> Routine[None]:
        """Raise SCL after its low phase; the program continues when its high phase may end."""
        self._meter.charge(i8=1, loop=1)
        yield SetPin(scl, 1)
        self._meter.charge(i8=1)
