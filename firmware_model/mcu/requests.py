"""Requests of a firmware program to the hardware.

A program is a generator. It *yields* a request for everything that takes time; whoever runs the
program (the emulated board, or a test) performs the request in virtual time and sends the answer
back. Before a request is performed, the processor is busy for the cycles charged to the program's
``Meter`` since the last one. Interrupt handlers are plain methods that the hardware calls at the
instant of their cause; the running program spends the cycles that they charge.
"""

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Pay:
    """Only spend the cycles charged so far."""


@dataclass(frozen=True)
class ReadTimer:
    """Read the free-running timer; the answer is an int, microseconds since power-up."""


@dataclass(frozen=True)
class SetPin:
    """Drive the output pin ``pin`` to ``level``: 0 or 1, or a number on a port of several lines."""

    pin: str
    level: int


@dataclass(frozen=True)
class ReadPin:
    """Read the input pin ``pin``; the answer is its level."""

    pin: str


@dataclass(frozen=True)
class AwaitPin:
    """Poll the input pin ``pin`` until it has ``level``; the answer is False after ``timeout_us``.

    One poll takes ``poll_cycles`` processor cycles, so the program continues at the end of a poll.
    """

    pin: str
    level: int
    timeout_us: int
    poll_cycles: int


@dataclass(frozen=True)
class Sleep:
    """Sleep until ``Hardware.wake`` is called, or at most until ``deadline_us`` (None: no limit).

    The answer is True if it was woken. A wake-up before the request is not lost. With ``wakeable``
    False only the deadline ends the sleep.
    """

    deadline_us: int | None
    wakeable: bool = True


@dataclass(frozen=True)
class StrobeRead:
    """Read bytes from the FPGA into ``target``: one data-clock cycle each, ``cycles`` long."""

    target: NDArray[np.uint8]
    cycles: int


@dataclass(frozen=True)
class BusAccess:
    """Read or write bytes on the external bus, one transaction after the other.

    The answer is the number of transactions: all, or fewer if a byte that was read exceeds
    ``above``; that byte is the last.
    """

    addresses: NDArray[np.int32]  #: (n,) int32, of 24 bits each
    data: NDArray[np.uint8]  #: (n,) uint8: the bytes to write, or the destination of the bytes read
    write: bool  #: True to write them
    cycles: int  #: processor cycles from one transaction to the next
    select: int  #: number of the chip select
    above: int  #: 0 to 255


@dataclass(frozen=True)
class CameraTransfer:
    """One message on the camera's control bus: write ``data``, then read ``read`` bytes.

    The answer is the bytes read, or None if the camera did not acknowledge.
    """

    data: bytes
    read: int = 0


@dataclass(frozen=True)
class Reset:
    """Restart the program and lose its RAM; ``cause``: bit in the reset-cause register, from 1."""

    cause: int


Request = (
    Pay
    | ReadTimer
    | SetPin
    | ReadPin
    | AwaitPin
    | Sleep
    | StrobeRead
    | BusAccess
    | CameraTransfer
    | Reset
)

T = TypeVar("T")
Routine = Generator[Request, Any, T]
"""Part of a firmware program that takes time; used with ``yield from``."""


def pause(us: int) -> Routine[None]:
    """Sleep for ``us``, even if woken."""
    now_us: int = yield ReadTimer()
    yield Sleep(now_us + us, wakeable=False)
