"""Reads the arguments of a program's calls from its memory, and writes the results back."""

import errno
import struct
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from cubestack.emulator.i2cdev.seccomp.notify import Notification, read_memory, write_memory
from cubestack.firmware_model.formats import i2c_socket
from cubestack.firmware_model.formats import linux_i2c as linux

MAX_PARTS = 1024
"""Limit of the parts of a vector: UIO_MAXIOV."""

RWF_HIPRI = 1
CURRENT_POSITION = (1 << 64) - 1

_RDWR = struct.Struct("=QI4x")
_MESSAGE = struct.Struct("=HHH2xQ")
_SMBUS = struct.Struct("=BB2xIQ")
_PART = struct.Struct("=QQ")


class Marshalled(NamedTuple):
    """A call for the emulated bus."""

    call: i2c_socket.Call  # kind of call
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
                i2c_socket.Call.IOCTL,
                i2c_socket.pack_ioctl(number, 0),
                partial(_put, call.pid, argument),
            )
        case _:
            return Marshalled(
                i2c_socket.Call.IOCTL, i2c_socket.pack_ioctl(number, argument), _without_data
            )


class Transfer(NamedTuple):
    """A read or a write, as its parts in the program's memory; each is a call of its own.

    So Linux performs them on a device without vectors (fs/read_write.c, do_loop_readv_writev).
    """

    reading: bool
    parts: list[tuple[int, int]]  # place and number of bytes

    def part(self, pid: int, place: int, count: int) -> Marshalled:
        """One part as a call; raises OSError."""
        count = min(count, linux.MAX_MESSAGE_BYTES)
        if self.reading:
            return Marshalled(
                i2c_socket.Call.READ, i2c_socket.pack_read(count), partial(_put, pid, place)
            )
        return Marshalled(i2c_socket.Call.WRITE, read_memory(pid, place, count), _without_data)


def plain(call: Notification, *, reading: bool, positioned: bool = False) -> Transfer:
    """Of read and write; ``positioned``: of pread and pwrite, whose offset is ignored.

    Raises OSError EINVAL for a negative offset.
    """
    if positioned and call.arguments[3] >> 63:
        raise OSError(errno.EINVAL, "the offset is negative")
    return Transfer(reading, [(call.arguments[1], call.arguments[2])])


def vector(
    call: Notification, *, reading: bool, positioned: bool = False, flags: bool = False
) -> Transfer:
    """Of readv and writev; ``positioned``: of preadv and pwritev; ``flags``: of preadv2, pwritev2.

    Raises OSError.
    """
    _, place, count, offset, _, chosen = call.arguments
    if positioned and offset >> 63 and not (flags and offset == CURRENT_POSITION):
        raise OSError(errno.EINVAL, "the offset is negative")
    if count > MAX_PARTS:
        raise OSError(errno.EINVAL, f"a vector has at most {MAX_PARTS} parts, not {count}")
    parts = list(_PART.iter_unpack(read_memory(call.pid, place, count * _PART.size)))
    if any(size >> 63 for _, size in parts):
        raise OSError(errno.EINVAL, "a part has a negative size")
    if flags and chosen & 0xFFFF_FFFF & ~RWF_HIPRI:
        raise OSError(errno.EOPNOTSUPP, "flags of a read or write are not supported")
    while parts and not parts[-1][1]:
        parts.pop()
    return Transfer(reading, parts)


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
            for place, part in zip(places, i2c_socket.split_rdwr(messages, data), strict=True):
                write_memory(call.pid, place, part)
        return result

    return Marshalled(i2c_socket.Call.RDWR, i2c_socket.pack_rdwr(messages), finish)


def _smbus(call: Notification, argument: int) -> Marshalled:
    found = _SMBUS.unpack(read_memory(call.pid, argument, _SMBUS.size))
    direction, command, size, place = found
    data = read_memory(call.pid, place, _given_bytes(direction, size)) if place else None
    body = i2c_socket.pack_smbus(linux.SmbusCall(direction, command, size, data))
    return Marshalled(i2c_socket.Call.SMBUS, body, partial(_put, call.pid, place))


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
