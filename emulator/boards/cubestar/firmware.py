"""CubeStar with a user's own firmware.

:mod:`cubestack.firmware_model.interface.cubestar.processor_pins` has the assignment of pins,
``stack`` the boards. These pins are defined for the published memory layout only.
"""

from functools import partial
from typing import Unpack

from cubestack.emulator.boards.contract import BoardOptions
from cubestack.emulator.boards.cubestar.stack import CubeStarStack
from cubestack.emulator.boards.firmware import I2C_MASTER, CameraWire, SerialWire, SlaveWire
from cubestack.emulator.boards.own_firmware import OwnFirmwareBoard
from cubestack.emulator.boards.serial_routes import parse_routes
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.sensor import Mlx75412
from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.outcome import Outgoing, OutgoingKind
from cubestack.emulator.rtl.factory import EngineKind
from cubestack.emulator.scene.sky import Scene
from cubestack.emulator.sim.firmware_fpga import FpgaCoupling, FpgaPin
from cubestack.emulator.sim.fpga_port import FpgaPort
from cubestack.firmware_model.interface.cubestar import INTERFACE, pins
from cubestack.firmware_model.interface.cubestar import processor_pins as wired
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.firmware_model.interface.efm32gg.pins import pin_number

TEMPERATURE, SUPPLY = 8, 9
COMPARATOR = (10, 18)
"""Analog inputs of the part besides the ADC's channels 0 to 7: see efm32gg/part/part.h."""

_INPUTS = (pins.ACK, pins.DATA)
_CONTROLS = (pins.ENABLE, pins.RNW, pins.BANK)
_CONTROL_PINS = {pin_number(wired.FPGA[name]): name for name in _CONTROLS}
_SWITCH_PINS = {pin_number(pin): channel for channel, pin in wired.SWITCHES.items()}


def coupled_pins() -> list[FpgaPin]:
    """The connections between processor and FPGA that need no Python."""
    return [
        FpgaPin(
            name,
            *wired.port_pin(wired.FPGA[name]),
            width=name.width,
            input=name in _INPUTS,
            alert=name is pins.ACK,
        )
        for name in (*_INPUTS, pins.DCLK)
    ]


class CubeStarFirmwareBoard(OwnFirmwareBoard, CubeStarStack):
    """One emulated CubeStar with a user's firmware."""

    camera: Mlx75412

    def __init__(
        self,
        scene: Scene | SkyView,
        image: Image,
        *,
        engine: EngineKind = "auto",
        baud: int = INTERFACE.baud,
        layout: Layout = Layout.COPIED,
        serial: str = "",
        callbacks: bool = False,
        **common: Unpack[BoardOptions],
    ) -> None:
        """Power up.

        Args:
            scene: what the camera sees.
            image: program in the processor's flash.
            engine: see ``make_engine``.
            baud: rate of the host's end of the satellite's UART; the firmware sets its own.
            layout: memory layout; ValueError for any but the published one.
            serial: further serial blocks led out, see ``parse_routes``.
            callbacks: connect even a compiled FPGA pin by pin, for tests.
            common: seed, kernel and i2c_bus, see ``Board``.
        """
        if layout is not Layout.COPIED:
            raise ValueError(
                f"own firmware runs on memory layout {Layout.COPIED.value}, not {layout.value}: "
                "the processor's pins for other layouts are not defined"
            )
        super().__init__(scene, engine=engine, layout=layout, **common)
        self._load(image, self.external_ram.size)
        self.machine.external[:] = self.external_ram
        self.external_ram = self.machine.external
        self._camera_wire = CameraWire(self.camera, wired.CAMERA_I2C.pin("SDA"))
        self._set_analog()
        bus = dict.fromkeys(I2C_MASTER, self._camera_bus)
        couple = partial(self._couple, compiled=not callbacks)
        self._start({OutgoingKind.PIN: self._pin, **bus}, baud, couple=couple)
        self.processor.fpga = self.engine
        satellite = wired.SATELLITE_UART
        self._connect(SerialWire(self.processor, satellite.pin("TX"), satellite.pin("RX")), baud)
        for route in parse_routes(serial):
            self._lead_out(route, baud)
        self.i2c_bus.attach_open(SlaveWire(self.processor, wired.SATELLITE_I2C.pin("SDA")))
        self.power.on_switch = self._supply_switched
        self.power.on_change = self._current_changed

    # --- pins -----------------------------------------------------------------------------------

    def _couple(self, fpga: FpgaPort, *, compiled: bool) -> FpgaCoupling:
        self._coupling = FpgaCoupling(self.machine, fpga, coupled_pins(), compiled=compiled)
        return self._coupling

    def _pin(self, one: Outgoing) -> None:
        """Handle a change of a pin; at -1 it floats, and a resistor defines its level."""
        if one.unit in _CONTROL_PINS:
            name, level = _CONTROL_PINS[one.unit], max(0, one.value)  # pulled down
            self._coupling.set_pin(name, level, one.time_ps)
            if name in self._pins and self._pins[name] != level:
                self._pin_changed(name, level)
        elif one.unit in _SWITCH_PINS:
            self.power.switch(_SWITCH_PINS[one.unit], one.value != 0)  # pulled up
        elif one.unit == _CAMERA_RESET:
            self.engine.run(max(self.engine.now_ps, one.time_ps))
            self.camera.set_reset_pin(int(one.value != 0), one.time_ps)  # pulled up

    def _camera_bus(self, one: Outgoing) -> None:
        self.engine.run(max(self.engine.now_ps, one.time_ps))
        self._camera_wire.handle(self.machine, one)

    # --- analog inputs --------------------------------------------------------------------------

    def _set_analog(self) -> None:
        analog = self.machine.analog
        analog[TEMPERATURE], analog[SUPPLY] = self.camera.temperature_c, wired.SUPPLY_VOLTS
        for channel, monitor in wired.MONITORS.items():
            volts = self.power.current_ma(channel) / 1000 * monitor.volts_per_a
            volts = min(volts, wired.SUPPLY_VOLTS)
            analog[monitor.adc_channel] = volts
            analog[COMPARATOR[monitor.comparator] + monitor.comparator_channel] = volts

    def _current_changed(self) -> None:
        before = self.machine.analog.copy()
        self._set_analog()
        if (before != self.machine.analog).any():
            self.processor.change_inputs(self.machine.analog_changed)


_CAMERA_RESET = pin_number(wired.CAMERA_RESET)
