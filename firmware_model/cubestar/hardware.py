"""What CubeStar's program sees of its EFM32GG beside the requests that take time."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.flash_store import FlashStore
from cubestack.firmware_model.node.hardware import NodeHardware


class CubeStarHardware(NodeHardware, Protocol):
    """Peripherals that the program uses without waiting for them.

    Attributes:
        external_ram: SRAM on the external bus, shape (bytes,), uint8.
        retention: battery-domain registers, kept over software resets, not over power-off.
        flash: non-volatile store.
        reset_causes: register of what reset the processor since the program cleared it; one of
            the single causes of ``ResetCause`` for each bit that is set.
    """

    external_ram: NDArray[np.uint8]
    retention: bytearray
    flash: FlashStore
    reset_causes: set[int]

    def switch_supply(self, channel: str, on: bool) -> None:
        """Turn the load switch of supply ``channel`` on or off."""

    def bus_read(self, select: int, address: int, count: int) -> bytes:
        """Load bytes over the external bus, in an interrupt: their cycles are still to be charged.

        Only where that bus leads to the FPGA; see ``BusAccess``.
        """

    def supply_current_ma(self, channel: str) -> float:
        """Current that the monitor of supply ``channel`` shows, in mA."""

    def temperature_c(self) -> float:
        """On-chip temperature sensor, in degrees Celsius."""
