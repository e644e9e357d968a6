"""Peripherals of CubeStar's EFM32GG that the program uses without a request."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.flash_store import FlashStore
from cubestack.firmware_model.node.hardware import NodeHardware


class CubeStarHardware(NodeHardware, Protocol):
    """Peripherals that the program uses without waiting for them."""

    external_ram: NDArray[np.uint8]  #: SRAM on the external bus, shape (bytes,), uint8
    retention: bytearray  #: battery-domain registers, kept over software resets, not over power-off
    flash: FlashStore  #: non-volatile store
    #: the reset-cause register: one of the single causes of ``ResetCause`` for each bit set since
    #: the program cleared it
    reset_causes: set[int]

    def switch_supply(self, channel: str, on: bool) -> None: ...

    def bus_read(self, select: int, address: int, count: int) -> bytes:
        """Read bytes over the external bus, in an interrupt; the caller charges their cycles.

        Only if that bus leads to the FPGA; see ``BusAccess``.
        """

    def supply_current_ma(self, channel: str) -> float:
        """Current at the monitor of supply ``channel``, in mA."""

    def temperature_c(self) -> float:
        """On-chip temperature sensor, in degrees Celsius."""
