"""An I2C bus in front of another one, for whoever listens to its transfers."""

from collections.abc import Generator, Mapping
from typing import Any

import simpy

from cubestack.emulator.bus.i2c import I2cBus, I2cMessage, I2cTarget

__all__ = ["BusTap"]


class BusTap(I2cBus):
    """Does what the bus behind it does; a subclass listens in ``transfer``."""

    def __init__(self, bus: I2cBus) -> None:
        """Stand in for ``bus``, which keeps its targets and what disturbs it."""
        self._bus = bus
        self.kernel = bus.kernel
        self.bit_ps = bus.bit_ps

    @property
    def targets(self) -> Mapping[int, I2cTarget]:
        """See I2cBus."""
        return self._bus.targets

    def attach(self, address: int, target: I2cTarget, *, general_call: bool = False) -> None:
        """See I2cBus."""
        self._bus.attach(address, target, general_call=general_call)

    def move(self, address: int, new_address: int) -> None:
        """See I2cBus."""
        self._bus.move(address, new_address)

    def transfer(self, messages: list[I2cMessage]) -> Generator[simpy.Event, Any, None]:
        """See I2cBus."""
        return self._bus.transfer(messages)
