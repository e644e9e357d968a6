"""Where pictures lie, how the FPGA stores them there, and how the program gets at them.

CubeStar thesis, section 3.3. Here the published layout, option 1: the FPGA stores into its own
SRAM, and the program copies the picture to the processor's. The others are in
:mod:`cubestack.firmware_model.cubestar.pictures.on_bus`.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import Detection, DetectionConfig, detect_stars
from cubestack.firmware_model.cubestar.hardware import CubeStarHardware
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES
from cubestack.firmware_model.interface.cubestar.pins import ACK, BANK, ENABLE, RNW
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, Routine, SetPin, StrobeRead

__all__ = ["ITERATION_US", "CopiedPictures", "Pictures", "test_pattern"]

ITERATION_US = 1_000_000


class Pictures(Protocol):
    """The newest picture, and the way of the next one into memory.

    All places are offsets into the newest picture, of ``IMAGE_BYTES``.

    Attributes:
        acknowledge: pin that tells that a picture is stored.
        while_storing: the newest picture can be worked on while the next one is stored.
        iteration_us: time of one turn of the loop.
    """

    acknowledge: str
    while_storing: bool
    iteration_us: int

    def start(self) -> Routine[None]:
        """Set the pins up after a reset."""

    def begin(self) -> Routine[None]:
        """Let the FPGA store the next whole frame."""

    def end(self, stored: bool) -> Routine[None]:
        """Let it stop; a frame that is ``stored`` becomes the newest picture."""

    def fetch(self) -> Routine[bool]:
        """Copy the stored frame to where the program works on it; False where nothing is copied."""

    def search(self, config: DetectionConfig) -> Routine[Detection]:
        """Find stars; see ``detect_stars``."""

    def read(self, start: int, count: int) -> Routine[bytes]:
        """Read bytes."""

    def read_now(self, start: int, count: int) -> bytes | None:
        """Read bytes in an interrupt; None where they are out of reach."""

    def write(self, start: int, data: NDArray[np.uint8]) -> Routine[None]:
        """Write bytes (n,)."""

    def test_memory(self) -> Routine[bool]:
        """Write a pattern and read it back, then its complement; the picture is lost."""


def test_pattern(size: int) -> NDArray[np.uint8]:
    """Bytes that differ between rows."""
    return (np.arange(size) * 167 >> 3).astype(np.uint8)


class CopiedPictures:
    """Pictures at the start of the processor's own external RAM."""

    acknowledge: str = ACK
    while_storing = True
    iteration_us = ITERATION_US

    def __init__(
        self, hardware: CubeStarHardware, state: State, meter: Meter, supply: SupplyMonitor
    ) -> None:
        """Use the external RAM of ``hardware``."""
        self._hardware = hardware
        self._state = state
        self._meter = meter
        self._supply = supply
        self._transfer_cycles = meter.table.operations["transfer_byte"].cycles

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
        yield StrobeRead(self._hardware.external_ram[:IMAGE_BYTES], self._transfer_cycles)
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
