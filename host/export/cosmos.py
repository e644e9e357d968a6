"""OpenC3 COSMOS command and telemetry definitions from an interface: one file of ``cmd_tlm``.

Each telemetry frame has a command ``REQUEST_…``. Answers carry no ID, so the target's interface
must tell COSMOS which packet it requested.
"""

from collections.abc import Iterator

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind
from cubestack.host.export.field_text import field_details

TYPES = {"bool1": "UINT", "u8": "UINT", "u16": "UINT", "u32": "UINT", "enum8": "UINT"}
TYPES |= {"i16": "INT", "f32": "FLOAT"}

ID_BITS = 8


def cosmos(interface: Interface) -> str:
    lines = [f"# {interface.name}, interface version {interface.version}."]
    for message in interface.messages:
        lines += ["", *_packet(interface.name.upper(), message)]
    return "\n".join(lines) + "\n"


def _packet(target: str, message: Message) -> Iterator[str]:
    name, meaning = message.name.upper(), _quoted(message.meaning)
    if message.kind is MessageKind.TELEMETRY:
        yield f"COMMAND {target} REQUEST_{name} LITTLE_ENDIAN {_quoted(f'Request {message.name}')}"
        yield _id(message)
        yield f"TELEMETRY {target} {name} LITTLE_ENDIAN {meaning}"
        for field in message.fields:
            yield f"  ITEM {_place(field, 0)} {_quoted(field_details(field))} {_endian(field)}"
            yield from _value(field, f"POLY_READ_CONVERSION 0 {1 / field.scale!r}")
    else:
        yield f"COMMAND {target} {name} LITTLE_ENDIAN {meaning}"
        yield _id(message)
        for field in message.fields:
            details = f"{_quoted(field_details(field))} {_endian(field)}"
            yield f"  PARAMETER {_place(field, ID_BITS)} {_range(field)} {details}"
            yield from _value(field, f"POLY_WRITE_CONVERSION 0 {field.scale:g}")


def _id(message: Message) -> str:
    number = f"{message.id} {message.id} {message.id}"
    return f'  ID_PARAMETER ID 0 {ID_BITS} UINT {number} "ID" LITTLE_ENDIAN'


def _place(field: Field, header_bits: int) -> str:
    """Name, offset, size and type; COSMOS counts bits from a byte's most significant one."""
    offset = field.bit_offset
    if field.type == "bool1":
        offset = offset - offset % 8 + 7 - offset % 8
    of_type = TYPES.get(field.type, "BLOCK")
    return f"{field.name.upper()} {header_bits + offset} {field.bits} {of_type}"


def _endian(field: Field) -> str:
    """A single bit has the same value in both byte orders, and a clear offset in big endian."""
    return "BIG_ENDIAN" if field.type == "bool1" else "LITTLE_ENDIAN"


def _range(field: Field) -> str:
    """Least and largest value and the default one, in the field's unit."""
    if isinstance(field.reset, bytes):
        return '""'
    low, high = field.raw_range
    if field.type == "f32":
        ends = "MIN", "MAX"
    else:
        ends = f"{low / field.scale:.10g}", f"{high / field.scale:.10g}"
    limits = zip(ends, field.ends, strict=True)
    least, largest = (end if limit is None else f"{limit:.10g}" for end, limit in limits)
    if field.also is not None:  # allowed beyond the limits, which COSMOS cannot express
        least, largest = ends
    return f"{least} {largest} {float(field.reset or 0):.10g}"


def _value(field: Field, conversion: str) -> Iterator[str]:
    if field.scale != 1:
        yield f"    {conversion}"
    if field.unit:
        yield f"    UNITS {_quoted(field.unit)} {_quoted(field.unit)}"
    for choice in field.choices or ():
        yield f"    STATE {choice.name} {int(choice)}"


def _quoted(text: str) -> str:
    plain = text.replace('"', "'")
    return f'"{plain}"'
