"""The CubeStar stack: which pin goes where.

CubeStar thesis, section 5.2 and tables C.1 to C.4. Camera to FPGA and SRAM, FPGA to processor,
processor to the satellite's UART and I2C, and the supplies of all three boards. Other memory
layouts than the published one are in :mod:`cubestack.emulator.boards.cubestar.layouts`.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.contract import Board
from cubestack.emulator.boards.cubestar.layouts import BOARDS
from cubestack.emulator.boards.peripherals import I2cCameraBus, NodePeripherals
from cubestack.emulator.bus.i2c import I2cBus
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.sensor import Mlx75412
from cubestack.emulator.faults.sites import CameraSite, Sites
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.factory import EngineKind, make_engine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.emulator.scene.sky import Scene
from cubestack.emulator.sim.processor import Processor
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.commands import WATCHDOG_US
from cubestack.firmware_model.cubestar.memory import EXTERNAL_RAM_BYTES, RETENTION_BYTES
from cubestack.firmware_model.cubestar.program import CubeStarProgram
from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS, ROWS
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


@lru_cache(maxsize=len(BOARDS))
def _wiring(layout: Layout) -> Wiring:
    """Kept, as an engine knows its library by the design's text, a slow thing."""
    return BOARDS[layout].wiring()


class CubeStarBoard(Board):
    """One emulated CubeStar.

    Attributes:
        camera: image sensor, which looks at the scene.
        stored: exposures of the frames stored last, the newest one at the end; None for a frame
            that was not sent.
    """

    engine: RtlEngine
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
        self._layout = BOARDS[layout]
        super().__init__(self._layout.power, seed=seed, kernel=kernel, i2c_bus=i2c_bus)
        self.engine = make_engine(_wiring(layout), kind=engine)
        self.camera = Mlx75412(scene, seed=seed)
        self._node_link(lambda: self.program.link, baud, i2c_address)
        self._hardware = _Efm32gg(self)
        self._scramble(self._hardware.external_ram)
        for memory in self.engine.memories.values():
            self._scramble(memory)
        self.engine.attach(self.camera)
        self.camera.on_change = self._camera_changed
        meter = Meter(CORTEX_M3)

        def boot(cause: int) -> CubeStarProgram:
            self._hardware.reset_causes.add(cause)
            self.program = CubeStarProgram(self._hardware, meter, catalogue, layout, switches)
            return self.program

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
        self._pins = dict.fromkeys(self._layout.controls, 0)
        self._accesses = False
        self._storing_since_ps = 0
        self.stored: deque[RollingShutter | None] = deque([None], maxlen=4)

    @property
    def flash(self) -> FlashStore:
        """The processor's flash, as a debugger sees it."""
        return self._hardware.flash

    @property
    def scene(self) -> Scene:
        """What the camera sees; see ``Board``."""
        return self.camera.scene

    @scene.setter
    def scene(self, scene: object) -> None:
        self.camera.scene = scene

    def busy(self) -> bool:
        """Whether anything is under way that does not wait for the host."""
        return super().busy() or not self.processor.waiting

    def probes(self) -> dict[str, int | str]:
        """What a trace shows: the main task's status beside what all boards show."""
        return super().probes() | {"task": TaskStatus(self.program.state.task_status).name}

    def _sites(self) -> Sites:
        return replace(
            super()._sites(),
            controls=self._layout.controls,
            cameras={"imager": CameraSite(self.camera, self.camera.power, "imager")},
            resets=self._resets(),
            memories={"external": self._hardware.external_ram} if self._layout.external_ram else {},
        )

    def _resets(self) -> dict[str, Callable[[], None]]:
        """What resets the processor against its program's will, the usual one first."""
        hangs = {ResetCause.WATCHDOG: WATCHDOG_US}
        return {
            name: partial(self.processor.reset, cause, hangs.get(cause, 0))
            for name, cause in (
                ("brown-out", ResetCause.BROWN_OUT_UNREGULATED),
                ("brown-out-regulated", ResetCause.BROWN_OUT_REGULATED),
                ("reset-pin", ResetCause.EXTERNAL_PIN),
                ("hang", ResetCause.WATCHDOG),
                ("lock-up", ResetCause.LOCKUP),
            )
        }

    def _reset_by_force(self) -> None:
        """Pins go low (pulled down: assumed); the retention registers are always up to date."""
        for pin in self._layout.controls:
            if self._pins[pin] and self.processor.fpga is not None:
                self.processor.fpga.set_pin(pin, 0)
                self._pin_changed(pin, 0)
        self.program.state.retain()

    def _camera_changed(self) -> None:
        self.engine.stream_changed()
        self.power.set_state("imager", "enabled" if self.camera.enabled else "disabled")

    def truth(self) -> NDArray[np.float64] | None:
        """Attitude (4,) at the mid-exposure of the middle row of the frame stored last.

        For whoever compares results; None when nothing was stored or the scene has no attitude.
        """
        latest = self.stored[-1]
        if latest is None:
            return None
        return self.camera.scene.truth(latest.mid_exposure_ps((ROWS - 1) / 2))

    def _pin_changed(self, pin: str, level: int) -> None:
        stored, self._pins[pin] = self._layout.storing(self._pins), level
        stores = self._layout.storing(self._pins)
        if stores > stored:
            self._storing_since_ps = self.kernel.now
        elif stores < stored:
            # The first whole frame was stored, however long the program let the FPGA go on.
            self.stored.append(self.camera.frame_from(self._storing_since_ps))
        self._set_states()

    def _accessed(self, busy: bool) -> None:
        self._accesses = busy
        self._set_states()

    def _set_states(self) -> None:
        for part, state in self._layout.states(self._pins, self._accesses).items():
            self.power.set_state(part, state)

    def _supply_switched(self, channel: str, on: bool) -> None:
        # A latch-up comes from outside, so the FPGA may have run ahead; see sim/processor.py.
        now_ps = max(self.kernel.now, self.engine.now_ps)
        self.engine.run(now_ps)
        if channel == "imager":
            self.camera.power(on, now_ps)
        srams, external = self.engine.memories, self._layout.external_ram
        if not external:
            # Without supply an FPGA leads nowhere, as a memory without supply does.
            reached = all(self.power.is_on(name) for name in ("imager", "memory"))
            for name in srams:
                self.engine.power_memory(name, reached)
        if not on:
            feeds_srams = channel == ("imager" if external else "memory")
            for memory in srams.values() if feeds_srams else [self._hardware.external_ram]:
                self._scramble(memory)


class _Efm32gg(NodePeripherals):
    """The processor's peripherals, as its program sees them."""

    def __init__(self, board: CubeStarBoard) -> None:
        super().__init__(board)
        self._camera = board.camera
        bytes_there = EXTERNAL_RAM_BYTES if board._layout.external_ram else 0
        self.external_ram = np.zeros(bytes_there, np.uint8)
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
