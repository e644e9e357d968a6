"""Results of a machine's run: why it ended, its messages, and the access that stopped it."""

from enum import IntEnum
from typing import NamedTuple


class StopReason(IntEnum):
    """Why a run ended; numbers as in api.cpp."""

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
    """End of a run."""

    reason: StopReason  #: why it ended
    now_ps: int  #: time of the machine
    sends: bool = False  #: whether there are messages in the outbox


class OutgoingKind(IntEnum):
    """Kinds of messages; numbers and values as in outbox.h."""

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
    SPI = 13
    FAULT = 14


class Outgoing(NamedTuple):
    """A message from the machine."""

    kind: OutgoingKind  #: meaning of the other attributes
    unit: int  #: port pin, peripheral or stimulus port
    value: int  #: level, byte or address
    extra: int  #: further value, by kind
    time_ps: int  #: time of the event
    text: str = ""  #: of text messages


class Watch(NamedTuple):
    """A range of memory whose accesses stop a run; ``kind`` is "r", "w" or "a" for both."""

    address: int
    length: int
    kind: str


class WatchHit(NamedTuple):
    """An access to a watched range, and the instruction that made it."""

    pc: int
    address: int
    size: int
    value: int
    write: bool
