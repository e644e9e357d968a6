"""The satellite's I2C bus: transfers with their time on the wire, and targets.

Repeated starts join the messages of one transfer, as in Linux's I2C_RDWR. A target that has no byte
ready stretches the clock. Targets may also listen to the general call, address 0. Not modelled: the
acknowledge of a byte that the host reads, 10-bit addresses, and arbitration between hosts: whole
transfers queue for the bus.
"""

import errno
from collections import deque
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol, TypeVar

import simpy

from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

T = TypeVar("T")

BITS_PER_BYTE = 9  # eight data bits and the acknowledge

LONGEST_STRETCH_PS = PS_PER_S
"""Longest clock stretch before a host aborts the transfer, as Linux's drivers do."""

GENERAL_CALL = 0x00

MAX_BLOCK_BYTES = 32
"""Largest length byte of a block; SMBus 2.0, section 5.5.7."""


@dataclass
class I2cMessage:
    """A message to a 7-bit ``address``: writes ``data``, or reads ``read`` bytes into it.

    With neither, only the address is sent, for writing: a probe.
    """

    address: int
    data: bytearray = field(default_factory=bytearray)
    read: int = 0
    # a read whose first byte is the number of bytes that follow the ``read`` ones
    block: bool = False
    probe_read: bool = False  # only the address is sent, for reading

    @property
    def reading(self) -> bool:
        return self.read > 0 or self.probe_read


class I2cError(OSError):
    """A transfer failed; errno as on Linux.

    ENXIO: no acknowledge of an address; EIO: of a byte; ETIMEDOUT: the clock was held low too long;
    EPROTO: a target sent an invalid block length.
    """


class I2cTarget(Protocol):
    """A device on the bus; called byte by byte, like the interrupts of a slave peripheral."""

    def i2c_start(self, read: bool) -> None: ...

    def i2c_write(self, byte: int) -> bool | None:
        """Receive a byte; returns whether to acknowledge it, None as ``i2c_read``."""

    def i2c_read(self) -> int | None:
        """The next byte to send, 0..255; None stretches the clock: called again one bit later."""

    def i2c_stop(self) -> None:
        """The transfer ended, or continued with another target."""


class OpenTarget(I2cTarget, Protocol):
    """A device that matches addresses itself; ``i2c_start`` is not called."""

    def i2c_address(self, address: int, read: bool) -> bool | None:
        """Handle a (repeated) start; returns whether to acknowledge, None as ``i2c_read``."""


class I2cFaultHook(Protocol):
    """A fault between a host and the targets; each method may wait, or raise I2cError."""

    def before_start(self) -> Generator[simpy.Event, Any, None]: ...

    def after_address(self, address: int) -> Generator[simpy.Event, Any, None]: ...

    def after_byte(self, address: int, read: bool) -> Generator[simpy.Event, Any, None]:
        """Called after a byte was sent by either side, before its acknowledge."""


class I2cTap:
    """Observer of whole transfers; subclasses override what they need."""

    def transfer_began(self, messages: list[I2cMessage]) -> None:
        """A host requests this transfer now; it queues behind those under way."""

    def transfer_ended(
        self, messages: list[I2cMessage], began_ps: int, error: BaseException | None
    ) -> None:
        """The transfer ended now; the messages hold the data read.

        With ``error``, it is incomplete.
        """


class Forwarder:
    """Forwards calls to the current program, or to all listeners of a general call."""

    def __init__(self, targets: Callable[[], Sequence[I2cTarget]]) -> None:
        """``targets`` is evaluated at each call, as a reset replaces the program."""
        self._targets = targets

    def i2c_start(self, read: bool) -> None:
        for target in self._targets():
            target.i2c_start(read)

    def i2c_write(self, byte: int) -> bool:
        acknowledges = [target.i2c_write(byte) for target in self._targets()]
        return any(acknowledges)  # none of these stretches the clock here

    def i2c_read(self) -> int | None:
        (target,) = self._targets()  # only one target can answer a read
        return target.i2c_read()

    def i2c_stop(self) -> None:
        for target in self._targets():
            target.i2c_stop()


class I2cBus:
    """One bus with any number of targets.

    Attributes:
        bit_ps: time of one bit.
        fault_hook: the current fault on the wires.
        taps: observers of the transfers.
    """

    def __init__(self, kernel: Kernel, hz: int = 100_000) -> None:
        """Create an idle bus at ``hz`` bits per second (positive, else ValueError)."""
        if hz <= 0:
            raise ValueError(f"an I2C bus needs a positive bit rate, not {hz} Hz")
        self.kernel = kernel
        self._targets: dict[int, I2cTarget] = {}
        self._listeners: list[I2cTarget] = []
        self._open: list[OpenTarget] = []
        self._general = Forwarder(lambda: self._listeners)
        self._occupied = False
        self._turns: deque[simpy.Event] = deque()
        self.fault_hook: I2cFaultHook | None = None
        self.taps: list[I2cTap] = []
        self.bit_ps = PS_PER_S // hz

    def attach(self, address: int, target: I2cTarget, *, general_call: bool = False) -> None:
        """Connect ``target`` at a free 7-bit ``address`` (else ValueError).

        With ``general_call`` it also receives writes to address 0.
        """
        if not 0x08 <= address <= 0x77:
            raise ValueError(f"I2C address {address:#04x} is not in 0x08..0x77")
        if address in self._targets:
            raise ValueError(f"I2C address {address:#04x} is already in use")
        self._targets[address] = target
        if general_call:
            self._listeners.append(target)

    def attach_open(self, target: OpenTarget) -> None:
        """Connect a target that is offered each address that no other target has."""
        self._open.append(target)

    @property
    def targets(self) -> Mapping[int, I2cTarget]:
        return self._targets

    def move(self, address: int, new_address: int) -> None:
        if address not in self._targets:
            raise ValueError(f"no I2C device is at address {address:#04x}")
        if address != new_address:
            self.attach(new_address, self._targets[address])
            del self._targets[address]

    def transfer(self, messages: list[I2cMessage]) -> Generator[simpy.Event, Any, None]:
        """Perform one transfer, after those already under way.

        Stores the data read in the messages. Raises I2cError, after the stop condition.
        """
        began_ps, failure = self.kernel.now, None
        for tap in self.taps:
            tap.transfer_began(messages)
        try:
            yield from self._in_turn(messages)
        except BaseException as error:
            failure = error
            raise
        finally:
            for tap in self.taps:
                tap.transfer_ended(messages, began_ps, failure)

    def _in_turn(self, messages: list[I2cMessage]) -> Generator[simpy.Event, Any, None]:
        if self._occupied:
            yield from self._wait_for_turn()
        self._occupied = True
        try:
            yield from self._transfer(messages)
        finally:
            self._end_turn()

    def _wait_for_turn(self) -> Generator[simpy.Event, Any, None]:
        turn = self.kernel.event()
        self._turns.append(turn)
        try:
            yield turn
        except BaseException:  # a cancelled transfer must not block the queue
            if turn.triggered:
                self._end_turn()
            else:
                self._turns.remove(turn)
            raise

    def _end_turn(self) -> None:
        if self._turns:
            self._turns.popleft().succeed()
        else:
            self._occupied = False

    def _transfer(self, messages: list[I2cMessage]) -> Generator[simpy.Event, Any, None]:
        addressed: I2cTarget | None = None
        failure: I2cError | None = None
        if self.fault_hook is not None:
            yield from self.fault_hook.before_start()
        try:
            for message in messages:
                yield self.kernel.timeout((1 + BITS_PER_BYTE) * self.bit_ps)
                if self.fault_hook is not None:
                    yield from self.fault_hook.after_address(message.address)
                target = self._find(message)
                if addressed is not None and target is not None and addressed is not target:
                    addressed.i2c_stop()
                if target is None:
                    target = yield from self._open_target(message, addressed)
                else:
                    target.i2c_start(message.reading)
                addressed = target
                yield from self._bytes(target, message)
        except I2cError as error:
            failure = error
        yield self.kernel.timeout(self.bit_ps)
        if addressed is not None:
            addressed.i2c_stop()
        if failure is not None:
            raise failure

    def _find(self, message: I2cMessage) -> I2cTarget | None:
        """The target with the address; None if only open targets can have it."""
        address = message.address
        if address == GENERAL_CALL and self._listeners and not message.reading:
            return self._general
        target = self._targets.get(address)
        if target is None and not self._open:
            raise I2cError(errno.ENXIO, f"no I2C device answers at {address:#04x}")
        return target

    def _open_target(
        self, message: I2cMessage, addressed: I2cTarget | None
    ) -> Generator[simpy.Event, Any, I2cTarget]:
        """Offer the address to all open targets; the first that accepts is the target."""
        address, found = message.address, None
        if addressed is not None and addressed not in self._open:
            addressed.i2c_stop()
        for target in self._open:
            offer = partial(target.i2c_address, address, message.reading)
            if (yield from self._call_stretched(offer, address)):
                found = found or target
        if found is None:
            raise I2cError(errno.ENXIO, f"no I2C device answers at {address:#04x}")
        return found

    def _bytes(self, target: I2cTarget, message: I2cMessage) -> Generator[simpy.Event, Any, None]:
        if message.reading:
            message.data = bytearray()
            wanted = message.read
            while len(message.data) < wanted:
                byte = yield from self._call_stretched(target.i2c_read, message.address)
                yield self.kernel.timeout(BITS_PER_BYTE * self.bit_ps)
                if self.fault_hook is not None:
                    yield from self.fault_hook.after_byte(message.address, read=True)
                if message.block and not message.data:
                    wanted += _block_length(byte, message.address)
                message.data.append(byte)
            return
        for byte in message.data:
            yield self.kernel.timeout(BITS_PER_BYTE * self.bit_ps)
            if self.fault_hook is not None:
                yield from self.fault_hook.after_byte(message.address, read=False)
            write = partial(target.i2c_write, byte)
            if not (yield from self._call_stretched(write, message.address)):
                text = f"I2C device {message.address:#04x} did not acknowledge byte {byte:#04x}"
                raise I2cError(errno.EIO, text)

    def _call_stretched(
        self, call: Callable[[], T | None], address: int
    ) -> Generator[simpy.Event, Any, T]:
        give_up_ps = self.kernel.now + LONGEST_STRETCH_PS
        while (answer := call()) is None:
            if self.kernel.now >= give_up_ps:
                text = f"I2C device {address:#04x} held the clock low for over 1 s"
                raise I2cError(errno.ETIMEDOUT, text)
            yield self.kernel.timeout(self.bit_ps)
        return answer


def _block_length(byte: int, address: int) -> int:
    if not 1 <= byte <= MAX_BLOCK_BYTES:
        text = f"I2C device {address:#04x} sent block length {byte}, not 1..{MAX_BLOCK_BYTES}"
        raise I2cError(errno.EPROTO, text)
    return byte
