"""Peripherals of CubeStar's EFM32GG that the program uses without a request."""

from collections.abc import Collection
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.cubestar.codes import ResetCause
from cubestack.firmware_model.mcu.memory import FlashStore
from cubestack.firmware_model.node.hardware import NodeHardware

_SUPPLY = (ResetCause.POWER_ON, ResetCause.BROWN_OUT_UNREGULATED, ResetCause.BROWN_OUT_REGULATED)
_MEANINGS: dict[frozenset[int], ResetCause] = {
    **{frozenset({one}): one for one in ResetCause},
    frozenset({ResetCause.EXTERNAL_PIN, ResetCause.WATCHDOG}): ResetCause.EXTERNAL_OR_WATCHDOG,
    frozenset({ResetCause.LOCKUP, ResetCause.SYSTEM_REQUEST}): ResetCause.LOCKUP_OR_SYSTEM_REQUEST,
}


def cause_of(bits: Collection[int]) -> ResetCause:
    """The published number of the reset-cause register's set bits, each given by its own number.

    The bits stay until the program clears them. The published list has numbers for two pairs of
    causes. The rest is assumed: a cause that includes a rise of the supply hides all others, and
    any other combination is undetermined.
    """
    hiding = [cause for cause in _SUPPLY if cause in bits]
    return hiding[0] if hiding else _MEANINGS.get(frozenset(bits), ResetCause.UNDETERMINED)


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
