"""Peripherals of AraMiS' ADSP-BF533 that the program uses without a request.

A frame is transferred by DMA while the processor does something else: the program starts the
parallel peripheral interface, and the end of the frame is an interrupt
(``AramisProgram.frame_ended``).

Memory map: AraMiS thesis, sections 2.3.2 and 2.3.3 and appendix A: 32 MB of SDRAM (MT48LC16M16),
flash parts of 4 MB (M29W320D), of which three hold the coded catalogue (assumed, from its size).
RAM holds the image, a second one that is transferred while the first is processed, and the
catalogue.
"""

from enum import IntEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.catalogue.hamming import coded_size
from cubestack.firmware_model.interface.aramis import IMAGE_BYTES, MOST_CATALOGUE_BYTES
from cubestack.firmware_model.mcu.memory import FlashStore
from cubestack.firmware_model.node.hardware import NodeHardware

MB = 1 << 20

SDRAM_BYTES = 32 * MB
FLASH_BYTES = 12 * MB  # chosen: three of the published parts of 4 MB

SECTOR_BYTES = 1 << 16  #: smallest part of the flash that can be erased

PICTURES_AT = (0, 2 * MB)
CATALOGUE_AT = 4 * MB
UPLOAD_AT = 16 * MB

_ENDS = (
    (PICTURES_AT[0] + IMAGE_BYTES, PICTURES_AT[1]),
    (PICTURES_AT[1] + IMAGE_BYTES, CATALOGUE_AT),
    (CATALOGUE_AT + MOST_CATALOGUE_BYTES, UPLOAD_AT),
    (UPLOAD_AT + MOST_CATALOGUE_BYTES, SDRAM_BYTES),
    (coded_size(8) + coded_size(MOST_CATALOGUE_BYTES), FLASH_BYTES),
)
assert all(end <= limit for end, limit in _ENDS)


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
