"""Peripherals of AraMiS' ADSP-BF533 that the program uses without a request.

A frame is transferred by DMA while the processor does something else: the program starts the
parallel peripheral interface, and the end of the frame is an interrupt
(``AramisProgram.frame_ended``).
"""

from enum import IntEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.flash_store import FlashStore
from cubestack.firmware_model.node.hardware import NodeHardware


class FrameEnd(IntEnum):
    """Result of a frame's transfer, from the interface's status register."""

    STORED = 0
    TOO_SHORT = 1  #: the frame ended before all lines came
    WRONG_LINES = 2  #: lines were longer or shorter than programmed


class AramisHardware(NodeHardware, Protocol):
    """Peripherals that the program uses without waiting for them."""

    sdram: NDArray[np.uint8]  #: the external dynamic memory, shape (bytes,), uint8
    #: the flash chips of the coded catalogue, shape (bytes,), uint8, a live view
    catalogue_flash: NDArray[np.uint8]
    flash: FlashStore  #: pages of settings in the boot flash
    reset_cause: int  #: ``ResetCause`` of :mod:`cubestack.firmware_model.interface.aramis.codes`

    def start_capture(self, target: NDArray[np.uint8]) -> None:
        """Transfer the next whole frame to ``target``, shape (rows, columns), part of SDRAM."""

    def stop_capture(self) -> None:
        """Cancel the awaited frame; no interrupt comes."""

    def switch_camera(self, on: bool) -> None: ...

    def camera_current_ma(self) -> float:
        """Current of the camera unit's supply, in mA."""
