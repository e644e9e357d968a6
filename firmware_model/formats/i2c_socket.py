"""The messages on the socket of an emulated I2C bus, declared once in ``MESSAGES``.

docs/reference/i2c-socket.md describes the protocol; its table is made from ``MESSAGES``. Both ends
run on one machine, so numbers are in its byte order, without padding. Each message follows its
length (u32). A request is a key (u64), the number of a call (u8), the fields of that call, and what
the table calls "rest". A reply is a result (i32: 0 or more, or a negative errno) and data.
"""

import os
import struct
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any

from cubestack.firmware_model.formats.linux_i2c import (
    MAX_MESSAGE_BYTES,
    MAX_MESSAGES,
    SMBUS_DATA_BYTES,
    MessageFlag,
    RdwrMessage,
    SmbusCall,
)
from cubestack.firmware_model.versions import I2C_SOCKET

VERSION = I2C_SOCKET.current
"""Of the protocol. HELLO, its refusal and the framing are the same in every version."""


class Call(IntEnum):
    """Requests of a client."""

    HELLO = 0
    OPEN = 1
    IOCTL = 2
    RDWR = 3
    SMBUS = 4
    READ = 5
    WRITE = 6
    MODE = 7


@dataclass(frozen=True)
class Part:
    """A field of a request."""

    name: str
    form: str  # as of the module struct
    type: str  # in the documentation
    meaning: str = ""


def _u8(name: str, meaning: str = "") -> Part:
    return Part(name, "B", "u8", meaning)


def _u16(name: str, meaning: str = "") -> Part:
    return Part(name, "H", "u16", meaning)


def _u32(name: str, meaning: str = "") -> Part:
    return Part(name, "I", "u32", meaning)


def _u64(name: str, meaning: str = "") -> Part:
    return Part(name, "Q", "u64", meaning)


@dataclass(frozen=True)
class Message:
    """A request, and the reply to it if it succeeds."""

    call: Call
    fields: tuple[Part, ...]
    rest: str  # what follows the fields
    result: str
    data: str  # of the reply
    meaning: str


RDWR_HEAD = (
    _u16("address", "7 bits"),
    _u16("flags", "of struct i2c_msg: 0x0001 reads, 0x0400 reads a block whose length comes first"),
    _u16("length", f"bytes to write or read, at most {MAX_MESSAGE_BYTES}"),
    _u16("sent", "bytes that follow: the length of a write, 0 of a read, 1 of a block read"),
)
"""Begins each message of RDWR."""

MESSAGES = (
    Message(
        Call.HELLO,
        (_u32("version", "that the client speaks"),),
        "",
        f"the version: {VERSION}",
        "the devices, one a line: name, blank, address as 0x1a",
        "Begins a connection. Every other request before it is refused.",
    ),
    Message(
        Call.OPEN,
        (_u32("flags", "of open(2); they decide what the file allows"),),
        "",
        "0",
        "",
        "Gives the connection's device file the key of the request, by which other connections "
        "reach it. Without it the file is open for both directions.",
    ),
    Message(
        Call.IOCTL,
        (
            _u32(
                "request",
                "number of ioctl: I2C_SLAVE, I2C_SLAVE_FORCE, I2C_TENBIT, I2C_PEC, "
                "I2C_RETRIES, I2C_TIMEOUT or I2C_FUNCS",
            ),
            _u64("argument"),
        ),
        "",
        "0",
        "of I2C_FUNCS: a u64",
        "Sets the file's address and options.",
    ),
    Message(
        Call.RDWR,
        (),
        f"1 to {MAX_MESSAGES} messages, as below",
        "their number",
        "the bytes of all reads; of a block its length first",
        "One transfer: start, the messages with repeated starts between them, stop.",
    ),
    Message(
        Call.SMBUS,
        (
            _u8("direction", "1 reads, 0 writes"),
            _u8("command"),
            _u8("given", "0 if there are no data"),
            _u8("unused"),
            _u32("size", "I2C_SMBUS_QUICK and so on"),
            Part(
                "data",
                f"{SMBUS_DATA_BYTES}s",
                f"{SMBUS_DATA_BYTES} bytes",
                "union i2c_smbus_data, filled up with zeros",
            ),
        ),
        "",
        "0",
        "of a read or a process call: the union's used part",
        "An SMBus transaction with the file's address.",
    ),
    Message(
        Call.READ,
        (_u64("count", f"more than {MAX_MESSAGE_BYTES} are cut"),),
        "",
        "bytes read",
        "the bytes",
        "Reads from the file's address.",
    ),
    Message(
        Call.WRITE,
        (),
        f"the bytes; more than {MAX_MESSAGE_BYTES} are cut",
        "bytes written",
        "",
        "Writes to the file's address.",
    ),
    Message(Call.MODE, (), "", "the access mode of the file's flags", "", "Requests the mode."),
)


def _form(parts: Iterable[Part]) -> struct.Struct:
    return struct.Struct("=" + "".join(part.form for part in parts))


LENGTH = struct.Struct("=I")
_HEAD = struct.Struct("=QB")
_MESSAGE = _form(RDWR_HEAD)
_RESULT = struct.Struct("=i")
_FORMS = {message.call: _form(message.fields) for message in MESSAGES}

MAX_REQUEST_BYTES = _HEAD.size + MAX_MESSAGES * (_MESSAGE.size + MAX_MESSAGE_BYTES)


def request(key: int, call: Call, body: bytes = b"") -> bytes:
    return _HEAD.pack(key, call) + body


def packet(data: bytes) -> bytes:
    """A request or reply as it is sent: behind its length."""
    return LENGTH.pack(len(data)) + data


def split_request(data: bytes) -> tuple[int, Call, bytes]:
    """Key, call and body of a request; raises ValueError."""
    try:
        key, call = _HEAD.unpack_from(data)
    except struct.error:
        raise ValueError(f"a request has at least {_HEAD.size} bytes, not {len(data)}") from None
    if call not in _FORMS:
        raise ValueError(f"no call has the number {call}")
    return key, Call(call), data[_HEAD.size :]


def reply(result: int, data: bytes = b"") -> bytes:
    return _RESULT.pack(result) + data


def split_reply(data: bytes) -> tuple[int, bytes]:
    """Result and data of a reply; raises ValueError."""
    if len(data) < _RESULT.size:
        raise ValueError(f"a reply has at least {_RESULT.size} bytes, not {len(data)}")
    return _RESULT.unpack_from(data)[0], data[_RESULT.size :]


def take_packet(received: bytearray, most: int | None = None) -> bytes | None:
    """Remove the oldest packet from ``received`` and return it; None unless it is complete.

    Raises ValueError for a packet of more than ``most`` bytes.
    """
    if len(received) < LENGTH.size:
        return None
    (length,) = LENGTH.unpack_from(received)
    if most is not None and length > most:
        raise ValueError(f"a request has at most {most} bytes, not {length}")
    end = LENGTH.size + length
    if len(received) < end:
        return None
    data = bytes(received[LENGTH.size : end])
    del received[:end]
    return data


def pack_hello(version: int = VERSION) -> bytes:
    return _FORMS[Call.HELLO].pack(version)


def unpack_hello(body: bytes) -> int:
    """The client's version; raises ValueError, like all unpack functions here.

    Other versions may add to the message, so what follows is ignored.
    """
    form = _FORMS[Call.HELLO]
    return int(_unpack(form, body[: form.size])[0])


def pack_targets(targets: Iterable[tuple[str, int]]) -> bytes:
    """Names and addresses of devices, as HELLO returns them."""
    return "".join(f"{name} {address:#04x}\n" for name, address in targets).encode()


def unpack_targets(data: bytes) -> list[tuple[str, int]]:
    pairs = (line.rsplit(" ", 1) for line in data.decode().splitlines())
    return [(name, int(address, 16)) for name, address in pairs]


def pack_ioctl(number: int, argument: int) -> bytes:
    return _FORMS[Call.IOCTL].pack(number & 0xFFFF_FFFF, argument)


def unpack_ioctl(body: bytes) -> tuple[int, int]:
    number, argument = _unpack(_FORMS[Call.IOCTL], body)
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
            raise ValueError("a message of RDWR breaks off")
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
    form = _FORMS[Call.SMBUS]
    return form.pack(call.direction, call.command, given, 0, call.size, call.data or b"")


def unpack_smbus(body: bytes) -> SmbusCall:
    direction, command, given, _, size, data = _unpack(_FORMS[Call.SMBUS], body)
    return SmbusCall(direction, command, size, data if given else None)


def pack_read(count: int) -> bytes:
    return _FORMS[Call.READ].pack(count)


def unpack_read(body: bytes) -> int:
    return int(_unpack(_FORMS[Call.READ], body)[0])


def pack_open(flags: int) -> bytes:
    return _FORMS[Call.OPEN].pack(flags)


def unpack_open(body: bytes) -> int:
    return int(_unpack(_FORMS[Call.OPEN], body)[0])


def _unpack(form: struct.Struct, data: bytes) -> tuple[Any, ...]:
    try:
        return form.unpack(data)
    except struct.error:
        raise ValueError(f"the fields have {form.size} bytes, not {len(data)}") from None


def socket_path(bus: int) -> Path:
    """Socket on which an emulation of this user serves I2C bus ``bus``.

    In ``$XDG_RUNTIME_DIR/cubestack``, else in a temporary folder with the user's number, which the
    server creates.
    """
    base = os.environ.get("XDG_RUNTIME_DIR")
    if base and Path(base).is_dir():
        return Path(base) / "cubestack" / f"i2c-{bus}"
    return Path(tempfile.gettempdir()) / f"cubestack-{os.getuid()}" / f"i2c-{bus}"
