"""The host's I2C adapter: puts transfers on the emulated bus and reports them as Linux does."""

import errno
from collections import deque
from collections.abc import Callable, Generator
from typing import Any

import simpy

from cubestack.emulator.i2c import I2cBus, I2cMessage, I2cNackError
from cubestack.emulator.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.interface.linux_i2c import Function

__all__ = ["FUNCTIONS", "I2cAdapter"]

FUNCTIONS = (
    Function.I2C
    | Function.PEC
    | Function.QUICK
    | Function.READ_BYTE
    | Function.WRITE_BYTE
    | Function.READ_BYTE_DATA
    | Function.WRITE_BYTE_DATA
    | Function.READ_WORD_DATA
    | Function.WRITE_WORD_DATA
    | Function.PROCESS_CALL
    | Function.READ_BLOCK_DATA
    | Function.WRITE_BLOCK_DATA
    | Function.BLOCK_PROCESS_CALL
    | Function.READ_I2C_BLOCK
    | Function.WRITE_I2C_BLOCK
)
"""All of plain I2C and SMBus; no 10-bit addresses, no messages without a start, no mangling."""


class I2cAdapter:
    """One master on a bus.

    Attributes:
        env: kernel.
        retries: how often a transfer is tried again that lost the bus to another master.
        timeout_ps: time after which it is not tried again.
        told: transfers whose end was told.
        holding: whether the end of a transfer is told only when ``release`` is called: for who runs
            virtual time ahead and knows when wall time gets there.
    """

    def __init__(
        self,
        env: Kernel,
        bus: I2cBus,
        *,
        address_errno: int = errno.ENXIO,
        data_errno: int = errno.EIO,
    ) -> None:
        """Become a master of ``bus``.

        Args:
            env: kernel of the bus.
            bus: the bus.
            address_errno: error of an address that nobody acknowledges; drivers differ.
            data_errno: error of a byte that is not acknowledged; drivers differ.
        """
        self.env = env
        self.retries = 0
        self.timeout_ps = PS_PER_S
        self.told = 0
        self.holding = False
        self._bus = bus
        self._errors = {errno.ENXIO: address_errno, errno.EIO: data_errno}
        self._pending = 0
        self._held: deque[tuple[int, int, Callable[[int], None]]] = deque()

    @property
    def busy(self) -> bool:
        """Whether a transfer is under way or waits for the wire."""
        return self._pending > 0

    def submit(self, messages: list[I2cMessage], done: Callable[[int], None]) -> None:
        """Start a transfer; ``done`` gets 0 at its end in virtual time, or a negative errno.

        Read data lands in the messages.
        """
        self._pending += 1
        self.env.process(self._perform(messages, done))

    def _perform(
        self, messages: list[I2cMessage], done: Callable[[int], None]
    ) -> Generator[simpy.Event, Any, None]:
        give_up_ps = self.env.now + self.timeout_ps
        for _ in range(1 + self.retries):
            result = yield from self._try(messages)
            if result != -errno.EAGAIN or self.env.now > give_up_ps:
                break
            yield self.env.timeout(self._bus.bit_ps)  # so that it does give up
        self._pending -= 1
        if self.holding:
            self._held.append((self.env.now, result, done))
        else:
            self._tell(result, done)

    def _try(self, messages: list[I2cMessage]) -> Generator[simpy.Event, Any, int]:
        try:
            yield from self._bus.transfer(messages)
        except I2cNackError as error:
            number = error.errno or errno.EIO
            return -self._errors.get(number, number)
        return 0

    def _tell(self, result: int, done: Callable[[int], None]) -> None:
        self.told += 1
        done(result)

    def release(self, time_ps: int) -> None:
        """Tell of the transfers that ended by ``time_ps``."""
        while self._held and self._held[0][0] <= time_ps:
            _, result, done = self._held.popleft()
            self._tell(result, done)

    def release_ps(self) -> int | None:
        """When the first transfer ended that was not told of; None without any."""
        return self._held[0][0] if self._held else None
