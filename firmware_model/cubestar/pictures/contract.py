"""How the program gets at its pictures, in any memory layout (CubeStar thesis, section 3.3)."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import Detection, DetectionConfig
from cubestack.firmware_model.cubestar.hardware import CubeStarHardware
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Routine

ITERATION_US = 1_000_000


class Pictures(ABC):
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

    def __init__(
        self, hardware: CubeStarHardware, state: State, meter: Meter, supply: SupplyMonitor
    ) -> None:
        """Reach the pictures by ``hardware``."""
        self._hardware = hardware
        self._state = state
        self._meter = meter
        self._supply = supply

    @abstractmethod
    def start(self) -> Routine[None]:
        """Set the pins up after a reset."""

    @abstractmethod
    def begin(self) -> Routine[None]:
        """Let the FPGA store the next whole frame."""

    @abstractmethod
    def end(self, stored: bool) -> Routine[None]:
        """Let it stop; a frame that is ``stored`` becomes the newest picture."""

    @abstractmethod
    def fetch(self) -> Routine[bool]:
        """Copy the stored frame to where the program works on it; False where nothing is copied."""

    @abstractmethod
    def search(self, config: DetectionConfig) -> Routine[Detection]:
        """Find stars; see ``detect_stars``."""

    @abstractmethod
    def read(self, start: int, count: int) -> Routine[bytes]:
        """Read bytes."""

    @abstractmethod
    def read_now(self, start: int, count: int) -> bytes | None:
        """Read bytes in an interrupt; None where they are out of reach."""

    @abstractmethod
    def write(self, start: int, data: NDArray[np.uint8]) -> Routine[None]:
        """Write bytes (n,)."""

    @abstractmethod
    def test_memory(self) -> Routine[bool]:
        """Write a pattern and read it back, then its complement; the picture is lost."""


def test_pattern(size: int) -> NDArray[np.uint8]:
    """Bytes that differ between rows."""
    return (np.arange(size) * 167 >> 3).astype(np.uint8)
