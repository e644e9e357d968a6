"""What comes of a run of a machine: why it ended, what left it, and which access stopped it."""

from enum import IntEnum
from typing import NamedTuple


class StopReason(IntEnum):
    """Why a run ended; the order is that of api.h."""

    TIME = 0
    OUTBOX = 1
    ASLEEP = 2
    AWAKE = 3
    BREAKPOINT = 4
    WATCHPOINT = 5
    STEPPED = 6
    HALTED = 7
    LOCKED_UP = 8
    FAULT = 9


class Stop(NamedTuple):
    """End of a run.

    Attributes:
        reason: of it.
        now_ps: time that the machine has reached.
        sends: whether there is something in the outbox, whatever the reason.
    """

    reason: StopReason
    now_ps: int
    sends: bool = False


class Kind(IntEnum):
    """What leaves a machine; the order, and what the values mean, are those of outbox.h."""

    PIN = 0
    UART = 1
    I2C_START = 2
    I2C_WRITE = 3
    I2C_READ = 4
    I2C_STOP = 5
    I2C_SLAVE = 6
    ITM = 7
    SEMIHOSTING = 8
    LOG = 9
    RESET = 10
    SLEEP = 11
    FLASH = 12
    SUPPLY = 13
    SPI = 14
    FAULT = 15


class Outgoing(NamedTuple):
    """Something for the outside.

    Attributes:
        kind: of it.
        unit: which port pin, peripheral or stimulus port.
        value: level, byte or address.
        extra: what else there is to know, by kind.
        time_ps: when it happened.
        text: of the kinds that are text.
    """

    kind: Kind
    unit: int
    value: int
    extra: int
    time_ps: int
    text: str = ""


class Watch(NamedTuple):
    """A range of memory whose accesses stop a run; ``kind`` is "r", "w" or "a" for both."""

    address: int
    length: int
    kind: str


class WatchHit(NamedTuple):
    """An access that a watchpoint saw, and the instruction that made it."""

    pc: int
    address: int
    size: int
    value: int
    write: bool
