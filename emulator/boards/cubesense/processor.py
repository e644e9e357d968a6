"""CubeSense's microcontroller: peripherals, and pins that do not lead to the FPGAs.

CubeSense thesis, table 3.3: two serial ports, the converter behind the current monitors, a timer;
sections 3.2 and 6.4.1: each camera's two control lines, open drain with pull-up resistors, and the
switches of memories and cameras.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from cubestack.emulator.boards.contract import Board
from cubestack.emulator.boards.node import NodePeripherals
from cubestack.emulator.camera.ov7620.sensor import Ov7620
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import PS_PER_US, Kernel
from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.interface.cubesense import pins
from cubestack.firmware_model.interface.cubesense.codes import Camera, Sram
from cubestack.firmware_model.interface.cubesense.pins import Monitor

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


class Pic18f45k20(NodePeripherals):
    """The peripherals; see ``firmware_model.cubesense.hardware``."""

    serial_number = "CSEMU1"

    def __init__(self, board: Board, *, mcu_addressing: bool) -> None:
        super().__init__(board)
        self._reset_ps = 0
        self._uarts = dict(zip(Port, board.uarts.values(), strict=True))
        self.mcu_addressing = mcu_addressing

    def reset(self) -> None:
        self._reset_ps = self._board.kernel.now

    def uart_send(self, data: bytes, port: Port = Port.NODE) -> None:
        self._uarts[port].send(data)

    def uart_backlog(self, port: Port = Port.NODE) -> int:
        return self._uarts[port].backlog

    def adc_counts(self, monitor: Monitor) -> int:
        current_ma = self._board.power.current_ma
        match monitor:
            case Monitor.SUPPLY_5V:
                current = current_ma()
            case Monitor.SUPPLY_3V3:
                # The cameras' own regulator feeds them from the 5 V supply.
                cameras = (CHANNELS[pin] for pin in pins.CAMERA_POWER.values())
                current = current_ma() - sum(map(current_ma, cameras))
            case Monitor.SRAM1 | Monitor.SRAM2:
                current = current_ma(monitor.value)
        return min(pins.ADC_FULL_SCALE, round(current / pins.MA_PER_COUNT))

    def uptime_us(self) -> int:
        """Time since the latest reset in us."""
        return (self._board.kernel.now - self._reset_ps) // PS_PER_US
