"""CubeSense's microcontroller pins that do not lead to the FPGAs.

CubeSense thesis, sections 3.2 and 6.4.1: each camera's two control lines, open drain with pull-up
resistors, and the switches of memories and cameras.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from cubestack.emulator.camera.ov7620.sensor import Ov7620
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.interface.cubesense import pins
from cubestack.firmware_model.interface.cubesense.codes import Camera, Sram

#: Load switch in the power table, by the pin that controls it.
CHANNELS = {
    **{pins.SRAM_POWER[sram]: sram.name for sram in Sram},
    **{pin: f"{camera.name.lower()}_camera" for camera, pin in pins.CAMERA_POWER.items()},
}

_CONTROL = {
    **{pin: (camera, "SCL") for camera, pin in pins.CAMERA_SCL.items()},
    **{pin: (camera, "SDA") for camera, pin in pins.CAMERA_SDA.items()},
}


@dataclass
class GpioPins:
    """Camera control lines and load switches; see ``emulator.sim.processor.Pins``."""

    _kernel: Kernel
    _cameras: Mapping[Camera, Ov7620]
    _power: PowerModel

    def __post_init__(self) -> None:
        self._driven: dict[str, int] = {}
        self.release()

    def __contains__(self, pin: object) -> bool:
        return pin in _CONTROL or pin in CHANNELS

    def release(self) -> None:
        """Set all pins to their level in reset: control lines pulled up, switches off."""
        for pin in CHANNELS:
            self.set_pin(pin, 0)
        for pin in _CONTROL:
            self.set_pin(pin, 1)

    def set_pin(self, pin: str, level: int) -> None:
        self._driven[pin] = level
        if pin in CHANNELS:
            self._power.switch(CHANNELS[pin], bool(level))
        else:
            camera, line = _CONTROL[pin]
            self._cameras[camera].on_pin(line, level, self._kernel.now)

    def get_pin(self, pin: str) -> int:
        """Level of a pin; a camera may pull its data line low."""
        if pin in _CONTROL and _CONTROL[pin][1] == "SDA":
            return self._driven[pin] & self._cameras[_CONTROL[pin][0]].sda
        return self._driven[pin]
