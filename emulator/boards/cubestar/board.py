"""CubeStar with this project's program.

CubeStar thesis, section 5.2 and tables C.1 to C.4.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Unpack

from cubestack.emulator.boards.contract import BoardOptions
from cubestack.emulator.boards.cubestar.stack import FORCED_RESETS, CubeStarStack
from cubestack.emulator.boards.node import I2cCameraBus, NodePeripherals
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.remap import Remap
from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.rtl.factory import EngineKind
from cubestack.emulator.scene.sky import Scene
from cubestack.emulator.sim.firmware_loops import offer_firmware_loops
from cubestack.emulator.sim.processor import Processor
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.commands import WATCHDOG_US
from cubestack.firmware_model.cubestar.memory import RETENTION_BYTES
from cubestack.firmware_model.cubestar.program import CubeStarProgram
from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.codes import ResetCause, TaskStatus
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.firmware_model.interface.cubestar.switches import DEFAULT_SWITCHES, CubeStarSwitches
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.memory import FlashStore

BOOT_US = 3_000
"""Reset to main: "a few milliseconds" (section 5.3.6)."""

CAMERA_BUS_HZ = 100_000
"""Standard mode; the sources give no rate."""

EBI_READ_CYCLES = CORTEX_M3.operations["ebi_read"].cycles
"""Processor cycles per byte that an interrupt reads over the external bus."""


class CubeStarBoard(CubeStarStack):
    """One emulated CubeStar, with this project's program."""

    processor: Processor
    program: CubeStarProgram

    def __init__(
        self,
        scene: Scene | SkyView,
        catalogue: StarCatalogue,
        *,
        engine: EngineKind = "auto",
        baud: int = INTERFACE.baud,
        layout: Layout = Layout.COPIED,
        i2c_address: int = INTERFACE.i2c_address,
        switches: CubeStarSwitches = DEFAULT_SWITCHES,
        **common: Unpack[BoardOptions],
    ) -> None:
        """Power up.

        Args:
            scene: what the camera sees.
            catalogue: star catalogue in the processor's flash.
            engine: see ``make_engine``.
            baud: rate of the satellite's UART.
            layout: memory layout, with the program for it.
            i2c_address: 7-bit address on the satellite's bus.
            switches: variants of the program and the camera.
            common: seed, kernel and i2c_bus, see ``Board``.
        """
        super().__init__(scene, engine=engine, layout=layout, **common)
        self.camera.remap = Remap(switches.remap)
        self._node_link(lambda: self.program.link, baud, i2c_address)
        meter = Meter(CORTEX_M3)
        offer_firmware_loops()

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
            on_access=self._access_changed,
            on_forced_reset=self._release_pins,
        )
        self.power.on_overcurrent = lambda channel: self.program.supply.overcurrent(channel)
        self.power.on_switch = self._supply_switched

    @property
    def flash(self) -> FlashStore:
        """The processor's flash, as a debugger sees it."""
        return self._hardware.flash

    def busy(self) -> bool:
        return super().busy() or not self.processor.waiting

    def probes(self) -> dict[str, int | str]:
        return super().probes() | {"task": TaskStatus(self.program.state.task_status).name}

    def sites(self) -> Sites:
        return replace(super().sites(), resets=self._resets())

    def _resets(self) -> dict[str, Callable[[], None]]:
        """Resets that the program did not request, the most common one first."""
        hangs = {ResetCause.WATCHDOG: WATCHDOG_US}
        return {
            name: partial(self.processor.reset, cause, hangs.get(cause, 0))
            for name, cause in FORCED_RESETS.items()
        }

    def _release_pins(self) -> None:
        """Pull the pins low (assumed) in a reset; the retention registers are up to date."""
        for pin in self.layout.controls:
            if self._pins[pin] and self.processor.fpga is not None:
                self.processor.fpga.set_pin(pin, 0)
                self._pin_changed(pin, 0)
        self.program.state.retain()


class _Efm32gg(NodePeripherals):
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
