"""Linux's I2C device files (/dev/i2c-N): their constants, and their calls as messages on a socket.

Numbers and limits are those of Linux's uapi headers linux/i2c.h and linux/i2c-dev.h. The messages
are this project's own; both ends run on one machine, so numbers are in its byte order. On the
socket each message follows its length (u32):

========  =====================================================================================
request   key u64, call u8, body; the key names an opened file, 0 is the connection's own
OPEN      flags u32 as of open(2), or no body for O_RDWR; from now on the key names the
          connection's own file
IOCTL     request u32, argument u64: the requests without a pointer argument, and FUNCS
RDWR      per message: address u16, flags u16, length u16, sent u16, then ``sent`` bytes
SMBUS     direction u8, command u8, data given u8, pad u8, size u32, data 34 bytes (filled up)
READ      count u64
WRITE     bytes
MODE      no body; the result is the file's access mode: of its flags, O_ACCMODE and O_PATH
reply     result i32 (0 or more, or a negative errno), data
========  =====================================================================================
"""

import os
import struct
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import Any

MAX_MESSAGES = 42  #: messages per I2C_RDWR
MAX_MESSAGE_BYTES = 8192  #: per message; read and write are truncated, I2C_RDWR rejects more
MAX_BLOCK_BYTES = 32  #: per SMBus block
SMBUS_DATA_BYTES = MAX_BLOCK_BYTES + 2  #: union i2c_smbus_data: a block, its length, a checksum


class Ioctl(IntEnum):
    """Requests of ioctl on a device file."""

    RETRIES = 0x0701
    TIMEOUT = 0x0702
    SLAVE = 0x0703
    TENBIT = 0x0704
    FUNCS = 0x0705
    SLAVE_FORCE = 0x0706
    RDWR = 0x0707
    PEC = 0x0708
    SMBUS = 0x0720


class MessageFlag(IntFlag):
    """Flags of a message of I2C_RDWR."""

    READ = 0x0001
    TEN_BIT = 0x0010
    DMA_SAFE = 0x0200
    RECEIVE_LENGTH = 0x0400


class Function(IntFlag):
    """Capabilities of an adapter, the result of I2C_FUNCS."""

    I2C = 0x0000_0001
    PEC = 0x0000_0008
    BLOCK_PROCESS_CALL = 0x0000_8000
    QUICK = 0x0001_0000
    READ_BYTE = 0x0002_0000
    WRITE_BYTE = 0x0004_0000
    READ_BYTE_DATA = 0x0008_0000
    WRITE_BYTE_DATA = 0x0010_0000
    READ_WORD_DATA = 0x0020_0000
    WRITE_WORD_DATA = 0x0040_0000
    PROCESS_CALL = 0x0080_0000
    READ_BLOCK_DATA = 0x0100_0000
    WRITE_BLOCK_DATA = 0x0200_0000
    READ_I2C_BLOCK = 0x0400_0000
    WRITE_I2C_BLOCK = 0x0800_0000


class SmbusSize(IntEnum):
    """Kinds of SMBus transactions."""

    QUICK = 0
    BYTE = 1
    BYTE_DATA = 2
    WORD_DATA = 3
    PROCESS_CALL = 4
    BLOCK_DATA = 5
    I2C_BLOCK_BROKEN = 6
    BLOCK_PROCESS_CALL = 7
    I2C_BLOCK_DATA = 8


class Call(IntEnum):
    """Calls on a device file."""

    OPEN = 0
    IOCTL = 1
    RDWR = 2
    SMBUS = 3
    READ = 4
    WRITE = 5
    MODE = 6


LENGTH = struct.Struct("=I")
_HEAD = struct.Struct("=QB")
_IOCTL = struct.Struct("=IQ")
_MESSAGE = struct.Struct("=HHHH")
_SMBUS = struct.Struct(f"=BBBxI{SMBUS_DATA_BYTES}s")
_COUNT = struct.Struct("=Q")
_FLAGS = struct.Struct("=I")
_RESULT = struct.Struct("=i")

MAX_REQUEST_BYTES = _HEAD.size + MAX_MESSAGES * (_MESSAGE.size + MAX_MESSAGE_BYTES)


@dataclass(frozen=True)
class RdwrMessage:
    """One message of I2C_RDWR."""

    address: int  #: 7-bit address
    flags: int  #: of MessageFlag
    length: int  #: bytes to write or to read
    #: bytes to write; for a read whose length the device sends, the first byte of its buffer
    data: bytes = b""


@dataclass(frozen=True)
class SmbusCall:
    """The argument of I2C_SMBUS."""

    direction: int  #: 1 to read, 0 to write
    command: int  #: command or register
    size: int  #: of SmbusSize
    data: bytes | None  #: the union i2c_smbus_data, 34 bytes; None for a null pointer


def smbus_data_bytes(size: int) -> int:
    """Largest part, in bytes, of the union i2c_smbus_data that a transaction of ``size`` uses."""
    if size in (SmbusSize.BYTE, SmbusSize.BYTE_DATA):
        return 1
    if size in (SmbusSize.WORD_DATA, SmbusSize.PROCESS_CALL):
        return 2
    return SMBUS_DATA_BYTES


def request(key: int, call: Call, body: bytes = b"") -> bytes:
    return _HEAD.pack(key, call) + body


def split_request(data: bytes) -> tuple[int, Call, bytes]:
    """Key, call and body of a request; raises ValueError."""
    try:
        key, call = _HEAD.unpack_from(data)
    except struct.error:
        raise ValueError(f"a request has at least {_HEAD.size} bytes, not {len(data)}") from None
    return key, Call(call), data[_HEAD.size :]


def reply(result: int, data: bytes = b"") -> bytes:
    return _RESULT.pack(result) + data


def take_packet(received: bytearray, most: int | None = None) -> bytes | None:
    """Remove the oldest packet from ``received`` and return it; None unless it is complete.

    Raises ValueError for a packet of more than ``most`` bytes.
    """
    if len(received) < LENGTH.size:
        return None
    (length,) = LENGTH.unpack_from(received)
    if most is not None and length > most:
        raise ValueError(f"a packet has {most} bytes at most, not {length}")
    end = LENGTH.size + length
    if len(received) < end:
        return None
    packet = bytes(received[LENGTH.size : end])
    del received[:end]
    return packet


def split_reply(data: bytes) -> tuple[int, bytes]:
    """Result and data of a reply; raises ValueError."""
    if len(data) < _RESULT.size:
        raise ValueError(f"a reply has at least {_RESULT.size} bytes, not {len(data)}")
    return _RESULT.unpack_from(data)[0], data[_RESULT.size :]


def pack_ioctl(number: int, argument: int) -> bytes:
    return _IOCTL.pack(number & 0xFFFF_FFFF, argument)


def unpack_ioctl(body: bytes) -> tuple[int, int]:
    number, argument = _unpack(_IOCTL, body)
    return number, argument


def pack_rdwr(messages: Sequence[RdwrMessage]) -> bytes:
    return b"".join(
        _MESSAGE.pack(message.address, message.flags, message.length, len(message.data))
        + message.data
        for message in messages
    )


def unpack_rdwr(body: bytes) -> list[RdwrMessage]:
    messages = []
    position = 0
    while position < len(body):
        address, flags, length, sent = _unpack(_MESSAGE, body[position : position + _MESSAGE.size])
        position += _MESSAGE.size + sent
        if position > len(body):
            raise ValueError("a message breaks off")
        messages.append(RdwrMessage(address, flags, length, body[position - sent : position]))
    return messages


def split_rdwr(messages: Sequence[RdwrMessage], data: bytes) -> list[bytes]:
    """The part of an RDWR reply for each message: empty for writes.

    The reply's data are the bytes read, message after message; one whose length the device sent
    begins with that length.
    """
    parts = []
    position = 0
    for message in messages:
        length = 0
        if message.flags & MessageFlag.READ:
            length = message.length
            if message.flags & MessageFlag.RECEIVE_LENGTH:
                length = message.data[0] + data[position]
        parts.append(data[position : position + length])
        position += length
    return parts


def pack_smbus(call: SmbusCall) -> bytes:
    given = call.data is not None
    return _SMBUS.pack(call.direction, call.command, given, call.size, call.data or b"")


def unpack_smbus(body: bytes) -> SmbusCall:
    direction, command, given, size, data = _unpack(_SMBUS, body)
    return SmbusCall(direction, command, size, data if given else None)


def pack_read(count: int) -> bytes:
    return _COUNT.pack(count)


def unpack_read(body: bytes) -> int:
    """Number of requested bytes; raises ValueError, like all unpack functions here."""
    return int(_unpack(_COUNT, body)[0])


def pack_open(flags: int) -> bytes:
    return _FLAGS.pack(flags)


def unpack_open(body: bytes) -> int:
    return int(_unpack(_FLAGS, body)[0]) if body else os.O_RDWR


def _unpack(form: struct.Struct, data: bytes) -> tuple[Any, ...]:
    try:
        return form.unpack(data)
    except struct.error:
        raise ValueError(f"must be {form.size} bytes, not {len(data)}") from None


def socket_path(bus: int) -> Path:
    """Socket on which an emulation of this user serves I2C bus ``bus``.

    In ``$XDG_RUNTIME_DIR/cubestack``, else in a temporary folder with the user's number, which the
    server creates.
    """
    base = os.environ.get("XDG_RUNTIME_DIR")
    if base and Path(base).is_dir():
        return Path(base) / "cubestack" / f"i2c-{bus}"
    return Path(tempfile.gettempdir()) / f"cubestack-{os.getuid()}" / f"i2c-{bus}"
