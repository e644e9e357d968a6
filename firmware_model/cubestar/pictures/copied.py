"""The published layout, option 1 of CubeStar thesis, section 3.3.

The FPGA stores into its own SRAM, and the program copies the picture to the processor's.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import Detection, DetectionConfig, detect_stars
from cubestack.firmware_model.cubestar.pictures.contract import ITERATION_US, Pictures, test_pattern
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES
from cubestack.firmware_model.interface.cubestar.pins import ACK, BANK, ENABLE, RNW
from cubestack.firmware_model.mcu.requests import Pay, Routine, SetPin, StrobeRead


class CopiedPictures(Pictures):
    """Pictures at the start of the processor's own external RAM."""

    acknowledge: str = ACK
    while_storing = True
    iteration_us = ITERATION_US

    @property
    def image(self) -> NDArray[np.uint8]:
        """The newest picture, shape (512, 1024), a live view of the external RAM."""
        return self._hardware.external_ram[:IMAGE_BYTES].reshape(ROWS, COLUMNS)

    def start(self) -> Routine[None]:
        """Pins are as a reset leaves them."""
        yield from ()

    def begin(self) -> Routine[None]:
        """Store into the selected bank."""
        yield SetPin(BANK, self._state.settings.get("SelectImageBank", "Bank"))
        yield SetPin(RNW, 0)
        yield SetPin(ENABLE, 1)

    def end(self, stored: bool) -> Routine[None]:
        """Stop."""
        yield SetPin(ENABLE, 0)

    def fetch(self) -> Routine[bool]:
        """Copy the frame from the FPGA's SRAM to the external RAM (imageTransfer)."""
        yield SetPin(RNW, 1)
        yield SetPin(ENABLE, 1)
        self._supply.sample()
        cycles = self._meter.table.operations["transfer_byte"].cycles
        yield StrobeRead(self._hardware.external_ram[:IMAGE_BYTES], cycles)
        yield SetPin(ENABLE, 0)
        yield SetPin(RNW, 0)
        return True

    def search(self, config: DetectionConfig) -> Routine[Detection]:
        """Find stars."""
        yield from ()
        return detect_stars(self.image, config, self._meter)

    def read(self, start: int, count: int) -> Routine[bytes]:
        """Read bytes."""
        yield from ()
        return self.read_now(start, count)

    def read_now(self, start: int, count: int) -> bytes:
        """Read bytes in an interrupt."""
        self._meter.charge(ebi_read=count)
        return self._hardware.external_ram[start : start + count].tobytes()

    def write(self, start: int, data: NDArray[np.uint8]) -> Routine[None]:
        """Write bytes."""
        yield from ()
        self._hardware.external_ram[start : start + len(data)] = data
        self._meter.charge(ebi_write=len(data))

    def test_memory(self) -> Routine[bool]:
        """Test all of the external RAM."""
        memory = self._hardware.external_ram
        size, passed = len(memory), True
        pattern = test_pattern(size)
        for wanted in (pattern, ~pattern):
            memory[:] = wanted
            self._meter.charge(ebi_write=size, loop=size)
            yield Pay()
            passed &= bool(np.array_equal(memory, wanted))
            self._meter.charge(ebi_read=size, loop=size)
            yield Pay()
        return passed
