"""A standalone Python module from an interface: a dataclass per message."""

from collections.abc import Iterator
from enum import IntEnum

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind

_HEAD = '''\
"""{name}, interface version {version}: its messages as dataclasses. Generated; needs Python 3.11.

A telecommand goes out by ``frame()``, ``request()`` requests a telemetry frame, and
``decode()`` decodes its data. Values are in their units, rounded to the nearest count.
"""

import dataclasses
import enum
import struct
from typing import ClassVar

I2C_ADDRESS = 0x{i2c_address:02X}
BAUD = {baud}

FORMATS = {{"u8": "B", "enum8": "B", "u16": "H", "u32": "I", "i16": "h", "f32": "f"}}


def frame(payload: bytes) -> bytes:
    """A frame on the serial line."""
    return b"\\x1f\\x7f" + payload.replace(b"\\x1f", b"\\x1f\\x1f") + b"\\x1f\\xff"


def payload(frame: bytes) -> bytes:
    """What a whole frame carries."""
    if frame[:2] != b"\\x1f\\x7f" or frame[-2:] != b"\\x1f\\xff":
        raise ValueError(f"not a frame: {{frame.hex(' ')}}")
    return frame[2:-2].replace(b"\\x1f\\x1f", b"\\x1f")


class Message:
    """What all have; MESSAGE_FIELDS: name to type, first bit, counts of one unit, choices."""

    MESSAGE_ID: ClassVar[int]
    MESSAGE_LENGTH: ClassVar[int]
    MESSAGE_FIELDS: ClassVar[dict]

    def encode(self) -> bytes:
        """Parameters or data; ValueError names the field whose value does not fit."""
        data = bytearray(self.MESSAGE_LENGTH)
        for name, (kind, bit, scale, _) in self.MESSAGE_FIELDS.items():
            value, at = getattr(self, name), bit // 8
            if kind == "bool1":
                data[at] |= bool(value) << bit % 8
            elif kind.startswith("bytes"):
                if len(value) != int(kind[5:]):
                    raise ValueError(f"{{name}} has {{len(value)}} bytes, must have {{kind[5:]}}")
                data[at : at + len(value)] = value
            else:
                if kind != "f32":
                    counts = int(abs(value) * scale + 0.5)
                    value = counts if value >= 0 else -counts
                try:
                    struct.pack_into("<" + FORMATS[kind], data, at, value)
                except (struct.error, OverflowError):
                    raise ValueError(f"{{name}}: {{getattr(self, name)}} does not fit") from None
        return bytes(data)

    @classmethod
    def decode(cls, data: bytes):
        """The message that carries ``data``; ValueError where that has another length."""
        if len(data) != cls.MESSAGE_LENGTH:
            expected = f"{{cls.__name__}} has {{cls.MESSAGE_LENGTH}} bytes"
            raise ValueError(f"{{expected}}, not {{len(data)}}")
        values = {{}}
        for name, (kind, bit, scale, choices) in cls.MESSAGE_FIELDS.items():
            at = bit // 8
            if kind == "bool1":
                value = bool(data[at] >> bit % 8 & 1)
            elif kind.startswith("bytes"):
                value = bytes(data[at : at + int(kind[5:])])
            else:
                (value,) = struct.unpack_from("<" + FORMATS[kind], data, at)
                value = value if scale == 1 else value / scale
                if choices is not None and value in list(choices):
                    value = choices(value)
            values[name] = value
        return cls(**values)


class Telecommand(Message):
    """What the host sends."""

    def frame(self) -> bytes:
        """On the serial line."""
        return frame(bytes([self.MESSAGE_ID]) + self.encode())


class Telemetry(Message):
    """What the node answers."""

    @classmethod
    def request(cls) -> bytes:
        """The bytes that request it on the serial line."""
        return frame(bytes([cls.MESSAGE_ID]))
'''


def python_module(interface: Interface) -> str:
    head = _HEAD.format(
        name=interface.name,
        version=interface.version,
        i2c_address=interface.i2c_address,
        baud=interface.baud,
    )
    lines = head.splitlines()
    for choices in (interface.ack_errors, *interface.choices):
        lines += ["", "", *_enumeration(choices)]
    known = {choices.__name__ for choices in interface.choices}
    for message in interface.messages:
        lines += ["", "", *_class(message, known)]
    return "\n".join(lines) + "\n"


def _enumeration(choices: type[IntEnum]) -> Iterator[str]:
    yield f"class {choices.__name__}(enum.IntEnum):"
    yield from (f"    {choice.name} = {int(choice)}" for choice in choices)


def _class(message: Message, known: set[str]) -> Iterator[str]:
    kind, base = (
        ("Tc", "Telecommand") if message.kind is MessageKind.TELECOMMAND else ("Tlm", "Telemetry")
    )
    yield "@dataclasses.dataclass"
    yield f"class {kind}{message.name}({base}):"
    yield f"    {f'{message.name}: {message.meaning}.'!r}"
    yield ""
    yield f"    MESSAGE_ID: ClassVar[int] = {message.id}"
    yield f"    MESSAGE_LENGTH: ClassVar[int] = {message.length}"
    yield "    MESSAGE_FIELDS: ClassVar[dict] = {"
    for field in message.fields:
        choices = field.choices.__name__ if field.choices is not None else "None"
        choices = choices if choices in known else "None"
        row = f'"{field.type}", {field.bit_offset}, {field.scale:g}, {choices}'
        yield f'        "{field.name}": ({row}),'
    yield "    }"
    for field in message.fields:
        unit = f" [{field.unit}]" if field.unit else ""
        yield f"    {field.name}: {_annotation(field)} = {_reset(field)}  # {field.meaning}{unit}"


def _annotation(field: Field) -> str:
    if field.type.startswith("bytes"):
        return "bytes"
    if field.type == "bool1":
        return "bool"
    return "int" if field.type != "f32" and field.scale == 1 else "float"


def _reset(field: Field) -> str:
    value = field.reset
    return repr(int(value) if isinstance(value, int) and field.type != "bool1" else value)
