"""AraMiS' hardware, faked, for parts of its program."""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.hardware import FLASH_BYTES, SDRAM_BYTES
from cubestack.firmware_model.interface.aramis import INTERFACE
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533
from cubestack.firmware_model.mcu.memory import FlashStore
from cubestack.firmware_model.mcu.requests import CameraTransfer

from ..host_side import HostSide
from ..runner import Runner


class Harness(Runner, HostSide):
    """Memories, the camera's register file, and its supply."""

    interface = INTERFACE

    def __init__(self) -> None:
        HostSide.__init__(self)
        Runner.__init__(self, BLACKFIN_BF533)
        self.sdram: NDArray[np.uint8] = np.zeros(SDRAM_BYTES, np.uint8)
        self.catalogue_flash: NDArray[np.uint8] = np.full(FLASH_BYTES, 0xFF, np.uint8)
        self.flash = FlashStore()
        self.reset_cause = 1
        #: registers: of the camera; None while it does not answer
        self.registers: dict[int, int] | None = {r.address: r.reset for r in REGISTERS}
        self.captures: list[NDArray[np.uint8]] = []  #: addresses of requested frames
        self.stopped = 0  #: how often one was given up
        self.camera_on = True

    def start_capture(self, target: NDArray[np.uint8]) -> None:
        self.captures.append(target)

    def stop_capture(self) -> None:
        self.stopped += 1

    def switch_camera(self, on: bool) -> None:
        self.camera_on = on

    def camera_current_ma(self) -> float:
        return 110.0 if self.camera_on else 0.0

    def transfer(self, request: CameraTransfer) -> bytes | None:
        self.now_us += 100
        if self.registers is None or not self.camera_on:
            return None
        register, *values = request.data
        for upper, lower in zip(values[::2], values[1::2], strict=False):
            self.registers[register] = upper << 8 | lower
        return self.registers.get(register, 0).to_bytes(2, "big")[: request.read]
