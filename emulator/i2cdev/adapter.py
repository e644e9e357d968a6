"""The host's I2C adapter: performs transfers on the emulated bus, with Linux's results."""

import errno
from collections import deque
from collections.abc import Callable, Generator
from typing import Any

import simpy

from cubestack.emulator.bus.i2c import I2cBus, I2cError, I2cMessage
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.formats.linux_i2c import Function

EVENTS = 8
"""Kernel events between two calls of ``may_continue``; fewer than in a transfer of a few bytes."""

Done = Callable[[int], None]

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
"""Plain I2C and SMBus; no 10-bit addresses, messages without a start or protocol mangling."""


class I2cAdapter:
    """One master on a bus.

    By default a transfer is a process of the kernel. If ``driven``, the scheduler runs the kernel
    through each transfer by ``drive``, which is faster.

    Attributes:
        retries: number of retries of a transfer that lost the bus to another master.
        timeout_ps: time after which it is not retried.
        answered: number of transfers whose result was returned.
        holding: whether results wait for ``release``, for a scheduler whose virtual time is ahead
            of wall time.
        driven: whether transfers wait for ``drive``.
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
            address_errno: error of an address that is not acknowledged; Linux's drivers differ.
            data_errno: error of a byte that is not acknowledged; Linux's drivers differ.
        """
        self.env = env
        self.retries = 0
        self.timeout_ps = PS_PER_S
        self.answered = 0
        self.holding = False
        self.driven = False
        self._bus = bus
        self._errors = {errno.ENXIO: address_errno, errno.EIO: data_errno}
        self._open: list[Done] = []
        self._gone = False
        self._waiting: deque[tuple[list[I2cMessage], Done]] = deque()
        self._driven: _Driven | None = None
        self._held: deque[tuple[int, int, Done]] = deque()

    @property
    def busy(self) -> bool:
        """Whether a transfer is under way or waits for the bus."""
        return len(self._open) > len(self._held)

    @property
    def begins_transfer(self) -> bool:
        """Whether ``drive`` would begin a transfer, not continue one."""
        return bool(self._waiting) and (self._driven is None or self._driven.ended)

    def submit(self, messages: list[I2cMessage], done: Done) -> None:
        """Start a transfer; at its end in virtual time, ``done`` receives 0 or a negative errno.

        The messages then hold the data read.
        """
        self._open.append(done)
        if self._gone:
            self._answer(-errno.EIO, done)
        elif self.driven:
            self._waiting.append((messages, done))
        else:
            self.env.process(self._perform(messages, done))

    def drive(self, may_continue: Callable[[], bool]) -> None:
        """Run the kernel through the current transfer, else through the oldest that waits.

        Must not be called by a process of the kernel. ``may_continue`` is called every ``EVENTS``
        events; when it returns False, the transfer continues as part of the kernel.
        """
        if self._driven is None or self._driven.ended:
            if not self._waiting:
                return
            self._driven = _Driven(self._perform(*self._waiting.popleft()))
        self._driven.drive(self.env, may_continue)

    def _perform(self, messages: list[I2cMessage], done: Done) -> Generator[simpy.Event, Any, None]:
        give_up_ps = self.env.now + self.timeout_ps
        for _ in range(1 + self.retries):
            result = yield from self._try(messages)
            if result != -errno.EAGAIN or self.env.now > give_up_ps:
                break
            yield self.env.timeout(self._bus.bit_ps)  # so that the time-out is reached
        if self.holding:
            self._held.append((self.env.now, result, done))
        else:
            self._answer(result, done)

    def _try(self, messages: list[I2cMessage]) -> Generator[simpy.Event, Any, int]:
        try:
            yield from self._bus.transfer(messages)
        except I2cError as error:
            number = error.errno or errno.EIO
            return -self._errors.get(number, number)
        return 0

    def _answer(self, result: int, done: Done) -> None:
        self.answered += 1
        self._open.remove(done)
        done(result)

    def pull(self) -> None:
        """Leave the bus: current and later transfers fail with EIO, until ``plug``."""
        self._gone, self._driven = True, None
        self._waiting.clear()
        self._held.clear()
        for done in list(self._open):
            self._answer(-errno.EIO, done)

    def plug(self, bus: I2cBus) -> None:
        """Become a master of another bus of the same kernel."""
        self._gone, self._bus = False, bus

    def release(self, time_ps: int) -> None:
        """Return the results of the transfers that ended by ``time_ps``."""
        while self._held and self._held[0][0] <= time_ps:
            _, result, done = self._held.popleft()
            self._answer(result, done)

    def release_ps(self) -> int | None:
        """When the first transfer with a held result ended; None without any."""
        return self._held[0][0] if self._held else None


class _Driven:
    """A generator of events that ``drive`` runs; between two drives, the kernel runs it.

    Attributes:
        ended: whether the generator has ended.
    """

    def __init__(self, steps: Generator[simpy.Event, Any, None]) -> None:
        self.ended = False
        self._steps = steps
        self._event: simpy.Event | None = None

    def drive(self, kernel: Kernel, may_continue: Callable[[], bool]) -> None:
        """Run ``kernel`` and the steps, until ``may_continue`` returns False."""
        event, left = self._event, 0
        if event is None:
            event, left = self._next_event(None), EVENTS
        else:
            event.callbacks.remove(self._continue)
        while event is not None:
            while not event.processed:
                if not left:
                    if not may_continue():
                        self._wait_for(event)
                        return
                    left = EVENTS
                kernel.step()
                left -= 1
            event = self._next_event(event)

    def _next_event(self, event: simpy.Event | None) -> simpy.Event | None:
        try:
            return self._steps.send(None if event is None else event.value)
        except StopIteration:
            self.ended = True
            return None

    def _wait_for(self, event: simpy.Event | None) -> None:
        """Continue the steps from the kernel when ``event`` has happened."""
        while event is not None and event.processed:
            event = self._next_event(event)
        self._event = event
        if event is not None:
            event.callbacks.append(self._continue)

    def _continue(self, event: simpy.Event) -> None:
        self._wait_for(self._next_event(event))
