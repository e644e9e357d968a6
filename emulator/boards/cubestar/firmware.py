"""CubeStar with a user's own firmware.

:mod:`cubestack.firmware_model.interface.cubestar.processor_pins` has the assignment of pins,
``stack`` the boards. These pins are defined for the published memory layout only.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Unpack

from cubestack.emulator.boards.contract import BoardOptions
from cubestack.emulator.boards.cubestar.stack import FORCED_RESETS, CubeStarStack
from cubestack.emulator.boards.firmware import CameraWire, Core, Insight, SerialWire, SlaveWire
from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.machine import FLASH_BASE, RAM_BASE, Machine
from cubestack.emulator.iss.outcome import Outgoing, OutgoingKind
from cubestack.emulator.rtl.factory import EngineKind
from cubestack.emulator.scene.sky import Scene
from cubestack.emulator.sim.firmware_fpga import FpgaCoupling, FpgaPin
from cubestack.emulator.sim.firmware_processor import FirmwareProcessor
from cubestack.emulator.sim.fpga_port import FpgaPort
from cubestack.firmware_model.interface.cubestar import INTERFACE, pins
from cubestack.firmware_model.interface.cubestar import processor_pins as wired
from cubestack.firmware_model.interface.cubestar.codes import ResetCause
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.firmware_model.interface.efm32gg.pins import pin_number

HANG_US = 1
"""Any value: only its own watchdog can end a hanging program."""

CAUSES: Mapping[int, int] = {
    ResetCause.POWER_ON: 1 << 0,
    ResetCause.BROWN_OUT_UNREGULATED: 1 << 1,
    ResetCause.BROWN_OUT_REGULATED: 1 << 2,
    ResetCause.EXTERNAL_PIN: 1 << 3,
    ResetCause.WATCHDOG: 1 << 4,
    ResetCause.LOCKUP: 1 << 5,
}
"""Bits of RMU_RSTCAUSE: EFM32GG Reference Manual, section 9.3.2."""

TEMPERATURE, SUPPLY = 8, 9
COMPARATOR = (10, 18)
"""Analog inputs of the part besides the ADC's channels 0 to 7: see efm32gg/part/part.h."""

_INPUTS = (pins.ACK, pins.DATA)
_CONTROLS = (pins.ENABLE, pins.RNW, pins.BANK)
_CONTROL_PINS = {pin_number(wired.FPGA[name]): name for name in _CONTROLS}
_SWITCH_PINS = {pin_number(pin): channel for channel, pin in wired.SWITCHES.items()}


class CubeStarFirmwareBoard(CubeStarStack):
    """One emulated CubeStar with a user's firmware.

    Attributes:
        machine: its processor: memories, registers, pins.
        image: the firmware.
    """

    processor: FirmwareProcessor
    insight: Insight

    def __init__(
        self,
        scene: Scene | SkyView,
        image: Image,
        *,
        engine: EngineKind = "auto",
        baud: int = INTERFACE.baud,
        layout: Layout = Layout.COPIED,
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
            callbacks: connect even a compiled FPGA pin by pin, for tests.
            common: seed, kernel and i2c_bus, see ``Board``.
        """
        if layout is not Layout.COPIED:
            raise ValueError(
                f"own firmware runs on memory layout {Layout.COPIED.value}, not {layout.value}: "
                "the processor's pins for other layouts are not defined"
            )
        super().__init__(scene, engine=engine, layout=layout, **common)
        self.image = image
        self.machine = Machine(external_bytes=self.external_ram.size)
        self.machine.external[:] = self.external_ram
        self.external_ram = self.machine.external
        self._scramble(self.machine.ram)
        self.machine.load(image)
        self.insight = Insight(self.machine)
        self._camera_wire = CameraWire(self.camera, wired.CAMERA_I2C.pin("SDA"))
        self._set_analog()
        bus = dict.fromkeys(
            (
                OutgoingKind.I2C_START,
                OutgoingKind.I2C_WRITE,
                OutgoingKind.I2C_READ,
                OutgoingKind.I2C_STOP,
            ),
            self._camera_bus,
        )
        self.processor = FirmwareProcessor(
            self.kernel,
            self.machine,
            handlers={
                OutgoingKind.PIN: self._pin,
                **bus,
                OutgoingKind.UART: lambda one: self._serial.sent(one),
            },
            causes=CAUSES,
            couple=partial(self._couple, compiled=not callbacks),
            look_ahead_ps=LineFormat(baud).character_ps * 9 // 10,
            on_activity=lambda awake: self.power.set_state(
                "processor", "run" if awake else "sleep"
            ),
        )
        self.processor.host.name = image.path.name if image.path else ""
        self.processor.fpga = self.engine
        self._serial = SerialWire(
            self.processor, wired.SATELLITE_UART.pin("TX"), wired.SATELLITE_UART.pin("RX")
        )
        self._serial.connect(self._serial_line(baud, lambda: self._serial))
        self.i2c_bus.attach_open(SlaveWire(self.processor, wired.SATELLITE_I2C.pin("SDA")))
        self.power.on_switch = self._supply_switched
        self.power.on_change = self._current_changed

    def busy(self) -> bool:
        return any(line.uart.busy for line in self.lines) or not self.processor.waiting

    def probes(self) -> dict[str, int | str]:
        return super().probes() | {"energy_mode": self.processor.energy_mode}

    def connect_console(self, report: Callable[[str], None]) -> None:
        self.processor.console = self.processor.on_fault = report

    def connect_program(
        self, on_exit: Callable[[int], None], read: Callable[[int], bytes | None]
    ) -> None:
        self.processor.on_exit, self.processor.host.read = on_exit, read

    def enable_semihosting(self, root: Path | None = None) -> None:
        """Answer semihosting calls; the program may use files in ``root``, if any."""
        self.machine.semihosting(True)
        self.processor.host.root = root

    def reset_pin(self) -> None:
        self.processor.reset(ResetCause.EXTERNAL_PIN)

    def close(self) -> None:
        super().close()
        self.processor.host.close()
        self.insight.close()
        self.machine.close()

    def sites(self) -> Sites:
        sites, machine = super().sites(), self.machine
        return replace(
            sites,
            resets=self._resets(),
            memories={**sites.memories, "ram": machine.ram, "flash": machine.flash},
            core=Core(self.processor),
            changed=self._memory_changed,
        )

    def _memory_changed(self, name: str, first: int, count: int) -> None:
        bases = {"ram": RAM_BASE, "flash": FLASH_BASE}
        if name in bases:
            self.machine.invalidate(bases[name] + first, count)

    def _resets(self) -> dict[str, Callable[[], None]]:
        return {
            name: partial(self.processor.reset, cause, HANG_US if name == "hang" else 0)
            for name, cause in FORCED_RESETS.items()
        }

    # --- pins -----------------------------------------------------------------------------------

    def _couple(self, fpga: FpgaPort, *, compiled: bool) -> FpgaCoupling:
        found = [
            FpgaPin(
                name,
                *wired.port_pin(wired.FPGA[name]),
                width=name.width,
                input=name in _INPUTS,
                alert=name is pins.ACK,
            )
            for name in (*_INPUTS, pins.DCLK)
        ]
        self._coupling = FpgaCoupling(self.machine, fpga, found, compiled=compiled)
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
