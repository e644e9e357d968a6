"""CubeStar with firmware of the user's own: what the pins of its processor lead to.

:mod:`cubestack.firmware_model.interface.cubestar.processor_pins` says which pin is which; what the
boards are is in ``stack``. Only the published memory layout has its FPGA at these pins.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from cubestack.emulator.boards.contract import NODE_PROTOCOL
from cubestack.emulator.boards.cubestar.stack import FORCED_RESETS, CubeStarStack
from cubestack.emulator.boards.firmware import CameraWire, Core, SerialWire, SlaveWire
from cubestack.emulator.boards.insight import Insight
from cubestack.emulator.bus.i2c import I2cBus
from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.machine import FLASH_BASE, RAM_BASE, Machine
from cubestack.emulator.iss.outcome import Kind, Outgoing
from cubestack.emulator.rtl.factory import EngineKind
from cubestack.emulator.scene.sky import Scene
from cubestack.emulator.sim.firmware_fpga import FpgaCoupling, FpgaPin
from cubestack.emulator.sim.firmware_processor import FirmwareProcessor
from cubestack.emulator.sim.fpga_port import FpgaPort
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.interface.cubestar import INTERFACE, pins
from cubestack.firmware_model.interface.cubestar import processor_pins as wired
from cubestack.firmware_model.interface.cubestar.codes import ResetCause
from cubestack.firmware_model.interface.cubestar.layouts import Layout
from cubestack.firmware_model.interface.efm32gg.pins import pin_number

HANG_US = 1
"""Any time: a hanging program is ended by its own watchdog, or not at all."""

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
"""Analog inputs of the part beside the ADC's channels 0 to 7: see its analog.h."""

_INPUTS = (pins.ACK, pins.DATA)
_CONTROLS = (pins.ENABLE, pins.RNW, pins.BANK)
_CONTROL_PINS = {pin_number(wired.FPGA[name]): name for name in _CONTROLS}
_SWITCH_PINS = {pin_number(pin): channel for channel, pin in wired.SWITCHES.items()}


class CubeStarFirmwareBoard(CubeStarStack):
    """One emulated CubeStar, with an image of the user's.

    Attributes:
        machine: its processor: memories, registers, pins.
        image: what runs on it.
    """

    processor: FirmwareProcessor
    insight: Insight

    def __init__(
        self,
        scene: Scene | SkyView,
        image: Image,
        *,
        seed: int = 0,
        engine: EngineKind = "auto",
        baud: int = INTERFACE.baud,
        kernel: Kernel | None = None,
        i2c_bus: I2cBus | None = None,
        layout: Layout = Layout.COPIED,
        callbacks: bool = False,
    ) -> None:
        """Power up.

        Args:
            scene: what the camera sees.
            image: program in the processor's flash.
            seed, kernel, i2c_bus: see ``Board``.
            engine: see ``make_engine``.
            baud: of the host's end of the satellite's UART; the firmware sets its own.
            layout: memory layout; ValueError for any but the published one.
            callbacks: reach the FPGA pin by pin, even a compiled one, for tests.
        """
        if layout is not Layout.COPIED:
            raise ValueError(
                f"own firmware runs on memory layout {Layout.COPIED.value}, not {layout.value}: "
                "the processor's pins to the other ones are not laid down"
            )
        super().__init__(
            scene, seed=seed, engine=engine, kernel=kernel, i2c_bus=i2c_bus, layout=layout
        )
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
            (Kind.I2C_START, Kind.I2C_WRITE, Kind.I2C_READ, Kind.I2C_STOP), self._camera_bus
        )
        self.processor = FirmwareProcessor(
            self.kernel,
            self.machine,
            handlers={Kind.PIN: self._pin, **bus, Kind.UART: lambda one: self._serial.sent(one)},
            causes=CAUSES,
            couple=partial(self._couple, compiled=not callbacks),
            look_ahead_ps=LineFormat(baud).character_ps * 9 // 10,
            on_activity=lambda awake: self.power.set_state(
                "processor", "run" if awake else "sleep"
            ),
        )
        self.processor.fpga = self.engine
        self._serial = SerialWire(
            self.processor, wired.SATELLITE_UART.pin("TX"), wired.SATELLITE_UART.pin("RX")
        )
        self._serial.connect(self._serial_line(baud, lambda: self._serial, title=NODE_PROTOCOL))
        self.i2c_bus.attach_open(SlaveWire(self.processor, wired.SATELLITE_I2C.pin("SDA")))
        self.power.on_switch = self._supply_switched
        self.power.on_change = self._current_changed

    def busy(self) -> bool:
        """Whether anything is under way that does not wait for the host."""
        return any(line.uart.busy for line in self.lines) or not self.processor.waiting

    def probes(self) -> dict[str, int | str]:
        """What a trace shows: the energy mode (0: awake) beside what all boards show."""
        return super().probes() | {"energy_mode": self.processor.energy_mode}

    def tell(self, say: Callable[[str], None]) -> None:
        """Give ``say`` what the firmware prints, and reports of its faults."""
        self.processor.console = self.processor.on_fault = say

    def reset_pin(self) -> None:
        """Reset the processor by its pin."""
        self.processor.reset(ResetCause.EXTERNAL_PIN)

    def close(self) -> None:
        """Release what the board holds."""
        super().close()
        self.insight.close()
        self.machine.close()

    def sites(self) -> Sites:
        """Where faults can hit."""
        sites, machine = super().sites(), self.machine
        return replace(
            sites,
            resets=self._resets(),
            memories={**sites.memories, "ram": machine.ram, "flash": machine.flash},
            core=Core(self.processor),
            changed=self._memory_changed,
        )

    def _memory_changed(self, name: str, first: int, count: int) -> None:
        """What was decoded of code that has changed is wrong."""
        bases = {"ram": RAM_BASE, "flash": FLASH_BASE}
        if name in bases:
            self.machine.invalidate(bases[name] + first, count)

    def _resets(self) -> dict[str, Callable[[], None]]:
        """What resets the processor against its program's will, the usual one first."""
        return {
            name: partial(self.processor.reset, cause, HANG_US if name == "hang" else 0)
            for name, cause in FORCED_RESETS.items()
        }

    # --- pins -----------------------------------------------------------------------------------

    def _couple(self, fpga: FpgaPort, *, compiled: bool) -> FpgaCoupling:
        """Lead the machine's pins to the FPGA, or to what stands before it."""
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
        """A pin has another level; -1: it floats, and what is soldered to it pulls it."""
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
        self._camera_wire.happened(self.machine, one)

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
            self.processor.give(self.machine.analog_changed)


_CAMERA_RESET = pin_number(wired.CAMERA_RESET)
