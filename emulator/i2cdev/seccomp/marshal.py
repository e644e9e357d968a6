"""A program's calls on a device file, fetched from its memory and put back into it."""

import errno
import struct
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from cubestack.emulator.i2cdev.seccomp.notify import Notification, read_memory, write_memory
from cubestack.firmware_model.formats.linux_i2c import (
    MAX_MESSAGE_BYTES,
    MAX_MESSAGES,
    Call,
    Ioctl,
    MessageFlag,
    RdwrMessage,
    SmbusCall,
    SmbusSize,
    pack_ioctl,
    pack_rdwr,
    pack_read,
    pack_smbus,
    smbus_data_bytes,
    split_rdwr,
)

MAX_PARTS = 1024
"""Parts of a vector: UIO_MAXIOV."""

_RDWR = struct.Struct("=QI4x")
_MESSAGE = struct.Struct("=HHH2xQ")
_SMBUS = struct.Struct("=BB2xIQ")
_PART = struct.Struct("=QQ")


class Marshalled(NamedTuple):
    """A call for the emulated bus.

    Attributes:
        call: which one.
        body: its packed body.
        finish: takes result and data of the reply, puts the data into the program and returns what
            the call returns there; raises OSError.
    """

    call: Call
    body: bytes
    finish: Callable[[int, bytes], int]


def ioctl(call: Notification) -> Marshalled:
    """An ioctl; raises OSError."""
    number, argument = call.arguments[1] & 0xFFFF_FFFF, call.arguments[2]
    match number:
        case Ioctl.RDWR:
            return _rdwr(call, argument)
        case Ioctl.SMBUS:
            return _smbus(call, argument)
        case Ioctl.FUNCS:
            return Marshalled(Call.IOCTL, pack_ioctl(number, 0), partial(_put, call.pid, argument))
        case _:
            return Marshalled(Call.IOCTL, pack_ioctl(number, argument), _nothing)


def read(call: Notification) -> Marshalled:
    """A read."""
    return _read(call.pid, call.arguments[1], call.arguments[2])


def write(call: Notification) -> Marshalled:
    """A write; raises OSError."""
    return _write(call.pid, call.arguments[1], call.arguments[2])


def readv(call: Notification) -> Marshalled:
    """A read of a vector, which ends short, after its first part; raises OSError."""
    return _read(call.pid, *_first_part(call))


def writev(call: Notification) -> Marshalled:
    """A write of a vector, which ends short, after its first part; raises OSError."""
    return _write(call.pid, *_first_part(call))


def _first_part(call: Notification) -> tuple[int, int]:
    count = call.arguments[2]
    if count > MAX_PARTS:
        raise OSError(errno.EINVAL, f"a vector has at most {MAX_PARTS} parts, not {count}")
    table = read_memory(call.pid, call.arguments[1], count * _PART.size)
    return next(((place, size) for place, size in _PART.iter_unpack(table) if size), (0, 0))


def _read(pid: int, place: int, count: int) -> Marshalled:
    body = pack_read(min(count, MAX_MESSAGE_BYTES))
    return Marshalled(Call.READ, body, partial(_put, pid, place))


def _write(pid: int, place: int, count: int) -> Marshalled:
    data = read_memory(pid, place, min(count, MAX_MESSAGE_BYTES))
    return Marshalled(Call.WRITE, data, _nothing)


def _rdwr(call: Notification, argument: int) -> Marshalled:
    array, count = _RDWR.unpack(read_memory(call.pid, argument, _RDWR.size))
    if not array or not 1 <= count <= MAX_MESSAGES:
        raise OSError(errno.EINVAL, f"1..{MAX_MESSAGES} messages, not {count}")
    messages: list[RdwrMessage] = []
    places: list[int] = []
    table = read_memory(call.pid, array, count * _MESSAGE.size)
    for address, flags, length, place in _MESSAGE.iter_unpack(table):
        sent = length if length <= MAX_MESSAGE_BYTES else 0  # too long: refused without a look
        if flags & MessageFlag.READ:
            sent = min(sent, 1) if flags & MessageFlag.RECEIVE_LENGTH else 0
        data = read_memory(call.pid, place, sent)
        messages.append(RdwrMessage(address, flags, length, data))
        places.append(place)

    def finish(result: int, data: bytes) -> int:
        if result >= 0:
            for place, part in zip(places, split_rdwr(messages, data), strict=True):
                write_memory(call.pid, place, part)
        return result

    return Marshalled(Call.RDWR, pack_rdwr(messages), finish)


def _smbus(call: Notification, argument: int) -> Marshalled:
    found = _SMBUS.unpack(read_memory(call.pid, argument, _SMBUS.size))
    direction, command, size, place = found
    data = read_memory(call.pid, place, _given_bytes(direction, size)) if place else None
    body = pack_smbus(SmbusCall(direction, command, size, data))
    return Marshalled(Call.SMBUS, body, partial(_put, call.pid, place))


def _given_bytes(direction: int, size: int) -> int:
    """How much of its data an SMBus transaction looks at before it starts, as i2c-dev does."""
    plain_read = direction == 1 and size <= SmbusSize.BLOCK_DATA and size != SmbusSize.PROCESS_CALL
    return 0 if plain_read else smbus_data_bytes(size)


def _put(pid: int, place: int, result: int, data: bytes) -> int:
    write_memory(pid, place, data)
    return result


def _nothing(result: int, _data: bytes) -> int:
    return result
