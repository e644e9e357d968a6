"""CubeStar with this project's program: what the processor's peripherals lead to.

CubeStar thesis, section 5.2 and tables C.1 to C.4.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from cubestack.emulator.boards.cubestar.stack import FORCED_RESETS, CubeStarStack
from cubestack.emulator.boards.peripherals import I2cCameraBus, NodePeripherals
from cubestack.emulator.bus.i2c import I2cBus
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.rtl.factory import EngineKind
from cubestack.emulator.scene.sky import Scene
from cubestack.emulator.sim.processor import Processor
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.commands import WATCHDOG_US
from cubestack.firmware_model.cubestar.memory import RETENTION_BYTES
from cubestack.firmware_model.cubestar.program import CubeStarProgram
from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.codes import ResetCause, TaskStatus
from cubestack.firmware_model.interface.cubestar.layouts import Layout
from cubestack.firmware_model.interface.cubestar.switches import DEFAULT_SWITCHES, CubeStarSwitches
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.flash_store import FlashStore

BOOT_US = 3_000
"""Reset to main: "a few milliseconds" (section 5.3.6)."""

CAMERA_BUS_HZ = 100_000
"""Standard mode; the sources give no rate."""

EBI_READ_CYCLES = CORTEX_M3.operations["ebi_read"].cycles
"""Of the processor, for a byte that an interrupt reads over its external bus."""


class CubeStarBoard(CubeStarStack):
    """One emulated CubeStar, with this project's program."""

    processor: Processor
    program: CubeStarProgram

    def __init__(
        self,
        scene: Scene | SkyView,
        catalogue: StarCatalogue,
        *,
        seed: int = 0,
        engine: EngineKind = "auto",
        baud: int = INTERFACE.baud,
        kernel: Kernel | None = None,
        i2c_bus: I2cBus | None = None,
        layout: Layout = Layout.COPIED,
        i2c_address: int = INTERFACE.i2c_address,
        switches: CubeStarSwitches = DEFAULT_SWITCHES,
    ) -> None:
        """Power up.

        Args:
            scene: what the camera sees.
            catalogue: star catalogue in the processor's flash.
            seed, kernel, i2c_bus: see ``Board``.
            engine: see ``make_engine``.
            baud: of the satellite's UART.
            layout: memory layout, with the program that belongs to it.
            i2c_address: 7-bit address on the satellite's bus.
            switches: of the program.
        """
        super().__init__(
            scene, seed=seed, engine=engine, kernel=kernel, i2c_bus=i2c_bus, layout=layout
        )
        self._node_link(lambda: self.program.link, baud, i2c_address)
        meter = Meter(CORTEX_M3)

        def boot(cause: int) -> CubeStarProgram:
            self._hardware.reset_causes.add(cause)
            self.program = CubeStarProgram(self._hardware, meter, catalogue, layout, switches)
            return self.program

        self._hardware = _Efm32gg(self)
        self.processor = Processor(
            self.kernel,
            meter,
            self.engine,
            I2cCameraBus(self.camera, REGISTERS.i2c_address, CAMERA_BUS_HZ),
            boot,
            power_on_cause=ResetCause.POWER_ON,
            boot_us=BOOT_US,
            on_pin=self._pin_changed,
            on_activity=lambda busy: self.power.set_state("processor", "run" if busy else "sleep"),
            on_access=self._accessed,
            on_forced_reset=self._reset_by_force,
        )
        self.power.on_overcurrent = lambda channel: self.program.supply.overcurrent(channel)
        self.power.on_switch = self._supply_switched

    @property
    def flash(self) -> FlashStore:
        """The processor's flash, as a debugger sees it."""
        return self._hardware.flash

    def busy(self) -> bool:
        """Whether anything is under way that does not wait for the host."""
        return super().busy() or not self.processor.waiting

    def probes(self) -> dict[str, int | str]:
        """What a trace shows: the main task's status beside what all boards show."""
        return super().probes() | {"task": TaskStatus(self.program.state.task_status).name}

    def sites(self) -> Sites:
        """Where faults can hit."""
        return replace(super().sites(), resets=self._resets())

    def _resets(self) -> dict[str, Callable[[], None]]:
        """What resets the processor against its program's will, the usual one first."""
        hangs = {ResetCause.WATCHDOG: WATCHDOG_US}
        return {
            name: partial(self.processor.reset, cause, hangs.get(cause, 0))
            for name, cause in FORCED_RESETS.items()
        }

    def _reset_by_force(self) -> None:
        """Pins go low (pulled down: assumed); the retention registers are always up to date."""
        for pin in self.layout.controls:
            if self._pins[pin] and self.processor.fpga is not None:
                self.processor.fpga.set_pin(pin, 0)
                self._pin_changed(pin, 0)
        self.program.state.retain()


class _Efm32gg(NodePeripherals):
    """The processor's peripherals, as its program sees them."""

    _board: CubeStarBoard

    def __init__(self, board: CubeStarBoard) -> None:
        super().__init__(board)
        self._camera = board.camera
        self.external_ram = board.external_ram
        self.retention = bytearray(RETENTION_BYTES)
        self.flash = FlashStore()
        self.reset_causes: set[int] = set()

    def bus_read(self, select: int, address: int, count: int) -> bytes:
        return self._board.processor.load(select, address, count, EBI_READ_CYCLES)

    def switch_supply(self, channel: str, on: bool) -> None:
        self._board.power.switch(channel, on)

    def supply_current_ma(self, channel: str) -> float:
        return self._board.power.current_ma(channel)

    def temperature_c(self) -> float:
        return self._camera.temperature_c
