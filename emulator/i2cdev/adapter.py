"""The host's I2C adapter: puts transfers on the emulated bus and reports them as Linux does."""

import errno
from collections import deque
from collections.abc import Callable, Generator
from typing import Any

import simpy

from cubestack.emulator.bus.i2c import I2cBus, I2cError, I2cMessage
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.formats.linux_i2c import Function

EVENTS = 8
"""Of the kernel; fewer than in a transfer of a few bytes."""

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
"""All of plain I2C and SMBus; no 10-bit addresses, no messages without a start, no mangling."""


class I2cAdapter:
    """One master on a bus.

    A transfer is a process of the kernel, which whoever runs virtual time need not know of; or it
    is ``driven``: whoever runs virtual time takes the kernel through it, which costs less.

    Attributes:
        env: kernel.
        retries: how often a transfer is tried again that lost the bus to another master.
        timeout_ps: time after which it is not tried again.
        told: transfers whose end was told.
        holding: whether the end of a transfer is told only when ``release`` is called: for who runs
            virtual time ahead and knows when wall time gets there.
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
            address_errno: error of an address that nobody acknowledges; drivers differ.
            data_errno: error of a byte that is not acknowledged; drivers differ.
        """
        self.env = env
        self.retries = 0
        self.timeout_ps = PS_PER_S
        self.told = 0
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
        """Whether a transfer is under way or waits for the wire."""
        return len(self._open) > len(self._held)

    @property
    def beginning(self) -> bool:
        """Whether ``drive`` would begin a transfer, not go on with one."""
        return bool(self._waiting) and (self._driven is None or self._driven.ended)

    def submit(self, messages: list[I2cMessage], done: Done) -> None:
        """Start a transfer; ``done`` gets 0 at its end in virtual time, or a negative errno.

        Read data lands in the messages.
        """
        self._open.append(done)
        if self._gone:
            self._tell(-errno.EIO, done)
        elif self.driven:
            self._waiting.append((messages, done))
        else:
            self.env.process(self._perform(messages, done))

    def drive(self, goes_on: Callable[[], bool]) -> None:
        """Take the kernel through the transfer under way, else through the oldest that waits.

        Not to be called by what the kernel runs. Ends early when ``goes_on``, asked every
        ``EVENTS`` events, says no; whoever runs the kernel then takes the transfer on.
        """
        if self._driven is None or self._driven.ended:
            if not self._waiting:
                return
            self._driven = _Driven(self._perform(*self._waiting.popleft()))
        self._driven.drive(self.env, goes_on)

    def _perform(self, messages: list[I2cMessage], done: Done) -> Generator[simpy.Event, Any, None]:
        give_up_ps = self.env.now + self.timeout_ps
        for _ in range(1 + self.retries):
            result = yield from self._try(messages)
            if result != -errno.EAGAIN or self.env.now > give_up_ps:
                break
            yield self.env.timeout(self._bus.bit_ps)  # so that it does give up
        if self.holding:
            self._held.append((self.env.now, result, done))
        else:
            self._tell(result, done)

    def _try(self, messages: list[I2cMessage]) -> Generator[simpy.Event, Any, int]:
        try:
            yield from self._bus.transfer(messages)
        except I2cError as error:
            number = error.errno or errno.EIO
            return -self._errors.get(number, number)
        return 0

    def _tell(self, result: int, done: Done) -> None:
        self.told += 1
        self._open.remove(done)
        done(result)

    def pull(self) -> None:
        """Leave the bus: what is under way fails, and whatever comes, until ``plug``."""
        self._gone, self._driven = True, None
        self._waiting.clear()
        self._held.clear()
        for done in list(self._open):
            self._tell(-errno.EIO, done)

    def plug(self, bus: I2cBus) -> None:
        """Become a master of another bus of the same kernel."""
        self._gone, self._bus = False, bus

    def release(self, time_ps: int) -> None:
        """Tell of the transfers that ended by ``time_ps``."""
        while self._held and self._held[0][0] <= time_ps:
            _, result, done = self._held.popleft()
            self._tell(result, done)

    def release_ps(self) -> int | None:
        """When the first transfer ended that was not told of; None without any."""
        return self._held[0][0] if self._held else None


class _Driven:
    """Steps that are no process of the kernel, but between two drives.

    Attributes:
        ended: whether the last one was done.
    """

    def __init__(self, steps: Generator[simpy.Event, Any, None]) -> None:
        """Prepare; ``steps`` yields the events that it waits for."""
        self.ended = False
        self._steps = steps
        self._event: simpy.Event | None = None

    def drive(self, kernel: Kernel, goes_on: Callable[[], bool]) -> None:
        """Take ``kernel`` through the steps, as long as ``goes_on`` says so."""
        event, left = self._event, 0
        if event is None:
            event, left = self._go_on(None), EVENTS
        else:
            event.callbacks.remove(self._happened)
        while event is not None:
            while not event.processed:
                if not left:
                    if not goes_on():
                        self._wait_for(event)
                        return
                    left = EVENTS
                kernel.step()
                left -= 1
            event = self._go_on(event)

    def _go_on(self, event: simpy.Event | None) -> simpy.Event | None:
        try:
            return self._steps.send(None if event is None else event.value)
        except StopIteration:
            self.ended = True
            return None

    def _wait_for(self, event: simpy.Event | None) -> None:
        """Let the kernel go on, whoever runs it, when ``event`` has happened."""
        while event is not None and event.processed:
            event = self._go_on(event)
        self._event = event
        if event is not None:
            event.callbacks.append(self._happened)

    def _happened(self, event: simpy.Event) -> None:
        self._wait_for(self._go_on(event))
