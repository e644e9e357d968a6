"""AraMiS' star tracker board.

AraMiS thesis, sections 2.3 to 2.5 and figures 2.2 and 2.12: the camera's pixel lines lead directly
to the Blackfin's parallel peripheral interface, its registers to a two-wire bus; flash and SDRAM;
the satellite's UART and I2C. There is no FPGA.
"""

from collections import deque
from copy import deepcopy
from dataclasses import replace
from typing import Literal, Unpack

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.aramis.memories import flash_with, undefined_sdram
from cubestack.emulator.boards.aramis.ppi import Ppi
from cubestack.emulator.boards.contract import Board, BoardOptions
from cubestack.emulator.boards.node import I2cCameraBus, NodePeripherals
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mt9m001.imager import NoiseTerms
from cubestack.emulator.camera.mt9m001.sensor import Mt9m001
from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.scene.sky import Scene
from cubestack.emulator.sim.firmware_loops import offer_firmware_loops
from cubestack.emulator.sim.power import Part, PowerTable
from cubestack.emulator.sim.processor import Processor
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.hardware import PICTURES_AT, FrameEnd
from cubestack.firmware_model.aramis.program import AramisProgram
from cubestack.firmware_model.interface.aramis import IMAGE_BYTES, INTERFACE, ResetCause
from cubestack.firmware_model.interface.aramis.codes import MeasurementOutcome, SensorState
from cubestack.firmware_model.interface.aramis.switches import DEFAULT_SWITCHES, AramisSwitches
from cubestack.firmware_model.interface.cameras.mt9m001 import COLUMNS, REGISTERS, ROWS
from cubestack.firmware_model.mcu.blackfin import blackfin_bf533
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.memory import FlashStore

#: MT9M001 data sheet: 363 mW working, 294 uW in standby, at 3.3 V. Other parts are assumed: the
#: thesis has only a figure with their sum (2.16).
ARAMIS_POWER = PowerTable(
    volts=3.3,
    parts={
        "camera": Part("camera", {"standby": 0.1, "working": 110.0}),
        "processor": Part(None, {"sleep": 15.0, "run": 110.0}),
        "sdram": Part(None, {"on": 60.0}),
        "flash": Part(None, {"on": 5.0}),
    },
    channels={"camera": None},
)

BOOT_US = 50_000
"""Reset to main: the boot code copies the program from flash to memory (assumed)."""

CAMERA_BUS_HZ = 100_000
"""Standard mode (assumed); the part has no I2C unit, so its program drives two pins."""

REMEMBERED = 8
"""Number of frames whose exposure is stored."""


class AramisBoard(Board):
    """One emulated star tracker.

    Attributes:
        ppi: interface between camera and processor.
        sdram: external memory, shape (bytes,), uint8.
        catalogue_flash: flash of the coded catalogue, shape (bytes,), uint8.
    """

    random_stream = (0xA7A,)
    program: AramisProgram

    def __init__(
        self,
        scene: Scene | SkyView,
        catalogue: Database | None,
        *,
        engine: str = "auto",
        baud: int = INTERFACE.baud,
        noise: NoiseTerms | None = None,
        i2c_address: int = INTERFACE.i2c_address,
        switches: AramisSwitches = DEFAULT_SWITCHES,
        **common: Unpack[BoardOptions],
    ) -> None:
        """Power up.

        Args:
            scene: what the camera sees.
            catalogue: stars and triangles in flash; None leaves the flash erased.
            engine: there is no FPGA, so ValueError for anything but "auto".
            baud: rate of the satellite's UART.
            noise: terms of the sensor's noise; default all.
            i2c_address: 7-bit address on the satellite's bus.
            switches: variants of the program.
            common: seed, kernel and i2c_bus, see ``Board``.
        """
        if engine != "auto":
            raise ValueError(f"AraMiS has no FPGA: its engine must be 'auto', not {engine!r}")
        super().__init__(ARAMIS_POWER, **common)
        undefined, rng = undefined_sdram(self.seed, self.random_stream)
        self.sdram, self.rng = undefined.copy(), deepcopy(rng)
        self.catalogue_flash = flash_with(catalogue).copy()
        self.camera = Mt9m001(scene, seed=self.seed, noise=noise)
        self.ppi = Ppi(self.kernel, self.camera)
        self.ppi.on_end, self.camera.on_change = self._frame_ended, self._camera_changed
        self._node_link(lambda: self.program.link, baud, i2c_address)
        self._hardware = _Blackfin(self)
        self._frames: deque[RollingShutter] = deque(maxlen=REMEMBERED)
        self._frame = 0
        meter = Meter(blackfin_bf533(library=switches.library))
        offer_firmware_loops()

        def boot(cause: int) -> AramisProgram:
            self._hardware.reset_cause = cause
            self._frames.clear()
            self._frame = 0
            self.program = AramisProgram(self._hardware, meter, switches)
            return self.program

        self.processor = Processor(
            self.kernel,
            meter,
            None,
            I2cCameraBus(self.camera, REGISTERS.i2c_address, CAMERA_BUS_HZ),
            boot,
            power_on_cause=ResetCause.POWER_ON,
            boot_us=BOOT_US,
            on_activity=lambda busy: self.power.set_state("processor", "run" if busy else "sleep"),
        )
        self.power.on_switch = lambda _channel, on: self.camera.power(on, self.kernel.now)
        self._show_camera()

    @property
    def scene(self) -> Scene:
        return self.camera.scene

    @scene.setter
    def scene(self, scene: object) -> None:
        self.camera.scene = scene

    def busy(self) -> bool:
        return super().busy() or self.ppi.busy

    def probes(self) -> dict[str, int | str]:
        state = self.program.state
        return super().probes() | {
            "task": SensorState(state.sensor).name,
            "measurement": MeasurementOutcome(state.measurement.outcome).name,
        }

    def truth(self, frame: int | None = None) -> NDArray[np.float64] | None:
        """Attitude (4,) at mid-exposure of the middle row of a stored frame.

        ``frame`` is its number since the program's start; None: the latest one. Returns None if
        that frame's exposure is not stored (any more), or the scene has no attitude.
        """
        age = 0 if frame is None else self._frame - frame
        if not 0 <= age < len(self._frames):
            return None
        return self.scene.truth(self._frames[-1 - age].mid_exposure_ps((ROWS - 1) / 2))

    def pictures(self) -> dict[str, NDArray[np.uint8]]:
        return {
            f"picture {place}": self.sdram[at : at + IMAGE_BYTES].reshape(ROWS, COLUMNS)
            for place, at in enumerate(PICTURES_AT)
        }

    def truths(self) -> dict[str, NDArray[np.float64]]:
        truth = self.truth()
        return {} if truth is None else {"attitude": truth}

    def irradiate(self, memory: Literal["flash", "sdram"], rate: float) -> int:
        """Invert each bit of the catalogue's flash or of the SDRAM with probability ``rate``.

        Returns their number; ValueError for a rate outside 0..1.
        """
        from cubestack.emulator.faults.parts import flip_bits

        target = self.catalogue_flash if memory == "flash" else self.sdram
        return flip_bits(target, rate, self.rng)

    def sites(self) -> Sites:
        # Its camera and processor have no specific faults.
        memories = {"sdram": self.sdram, "flash": self.catalogue_flash}
        return replace(super().sites(), memories=memories)

    def _frame_ended(self, end: FrameEnd) -> None:
        if end is FrameEnd.STORED and self.ppi.stored is not None:
            self._frames.append(self.ppi.stored)
            self._frame += 1
        self.program.frame_ended(end)

    def _camera_changed(self) -> None:
        self.ppi.lines_changed()
        self._show_camera()

    def _show_camera(self) -> None:
        self.power.set_state("camera", "working" if self.camera.enabled else "standby")


class _Blackfin(NodePeripherals):
    """The processor's peripherals, as its program uses them."""

    def __init__(self, board: AramisBoard) -> None:
        super().__init__(board)
        self.start_capture, self.stop_capture = board.ppi.start, board.ppi.stop
        self.sdram, self.catalogue_flash = board.sdram, board.catalogue_flash
        self.flash = FlashStore()
        self.reset_cause = int(ResetCause.POWER_ON)

    def switch_camera(self, on: bool) -> None:
        self._board.power.switch("camera", on)

    def camera_current_ma(self) -> float:
        return self._board.power.current_ma("camera")
