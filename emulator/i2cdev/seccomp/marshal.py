"""Reads the arguments of a program's calls from its memory, and writes the results back."""

import errno
import struct
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from cubestack.emulator.i2cdev.seccomp.notify import Notification, read_memory, write_memory
from cubestack.firmware_model.formats import linux_i2c as linux

MAX_PARTS = 1024
"""Limit of the parts of a vector: UIO_MAXIOV."""

_RDWR = struct.Struct("=QI4x")
_MESSAGE = struct.Struct("=HHH2xQ")
_SMBUS = struct.Struct("=BB2xIQ")
_PART = struct.Struct("=QQ")


class Marshalled(NamedTuple):
    """A call for the emulated bus."""

    call: linux.Call  # kind of call
    body: bytes  # its packed body
    # receives result and data of the reply, writes the data to the program's memory and returns the
    # result of the call; raises OSError
    finish: Callable[[int, bytes], int]


def ioctl(call: Notification) -> Marshalled:
    number, argument = call.arguments[1] & 0xFFFF_FFFF, call.arguments[2]
    match number:
        case linux.Ioctl.RDWR:
            return _rdwr(call, argument)
        case linux.Ioctl.SMBUS:
            return _smbus(call, argument)
        case linux.Ioctl.FUNCS:
            return Marshalled(
                linux.Call.IOCTL, linux.pack_ioctl(number, 0), partial(_put, call.pid, argument)
            )
        case _:
            return Marshalled(linux.Call.IOCTL, linux.pack_ioctl(number, argument), _without_data)


def read(call: Notification, *, vector: bool = False) -> Marshalled:
    """A read; of a ``vector``, only the first part is read, as a short read. Raises OSError."""
    place, count = _first_part(call) if vector else call.arguments[1:3]
    body = linux.pack_read(min(count, linux.MAX_MESSAGE_BYTES))
    return Marshalled(linux.Call.READ, body, partial(_put, call.pid, place))


def write(call: Notification, *, vector: bool = False) -> Marshalled:
    """A write; of a ``vector``, only the first part is written. Raises OSError."""
    place, count = _first_part(call) if vector else call.arguments[1:3]
    data = read_memory(call.pid, place, min(count, linux.MAX_MESSAGE_BYTES))
    return Marshalled(linux.Call.WRITE, data, _without_data)


def _first_part(call: Notification) -> tuple[int, int]:
    count = call.arguments[2]
    if count > MAX_PARTS:
        raise OSError(errno.EINVAL, f"a vector has at most {MAX_PARTS} parts, not {count}")
    table = read_memory(call.pid, call.arguments[1], count * _PART.size)
    return next(((place, size) for place, size in _PART.iter_unpack(table) if size), (0, 0))


def _rdwr(call: Notification, argument: int) -> Marshalled:
    array, count = _RDWR.unpack(read_memory(call.pid, argument, _RDWR.size))
    if not array or not 1 <= count <= linux.MAX_MESSAGES:
        raise OSError(errno.EINVAL, f"1..{linux.MAX_MESSAGES} messages, not {count}")
    messages: list[linux.RdwrMessage] = []
    places: list[int] = []
    table = read_memory(call.pid, array, count * _MESSAGE.size)
    for address, flags, length, place in _MESSAGE.iter_unpack(table):
        sent = length if length <= linux.MAX_MESSAGE_BYTES else 0  # longer ones are rejected later
        if flags & linux.MessageFlag.READ:
            sent = min(sent, 1) if flags & linux.MessageFlag.RECEIVE_LENGTH else 0
        data = read_memory(call.pid, place, sent)
        messages.append(linux.RdwrMessage(address, flags, length, data))
        places.append(place)

    def finish(result: int, data: bytes) -> int:
        if result >= 0:
            for place, part in zip(places, linux.split_rdwr(messages, data), strict=True):
                write_memory(call.pid, place, part)
        return result

    return Marshalled(linux.Call.RDWR, linux.pack_rdwr(messages), finish)


def _smbus(call: Notification, argument: int) -> Marshalled:
    found = _SMBUS.unpack(read_memory(call.pid, argument, _SMBUS.size))
    direction, command, size, place = found
    data = read_memory(call.pid, place, _given_bytes(direction, size)) if place else None
    body = linux.pack_smbus(linux.SmbusCall(direction, command, size, data))
    return Marshalled(linux.Call.SMBUS, body, partial(_put, call.pid, place))


def _given_bytes(direction: int, size: int) -> int:
    """Number of data bytes that an SMBus transaction sends, as in i2c-dev."""
    plain_read = (
        direction == 1
        and size <= linux.SmbusSize.BLOCK_DATA
        and size != linux.SmbusSize.PROCESS_CALL
    )
    return 0 if plain_read else linux.smbus_data_bytes(size)


def _put(pid: int, place: int, result: int, data: bytes) -> int:
    write_memory(pid, place, data)
    return result


def _without_data(result: int, _data: bytes) -> int:
    return result
