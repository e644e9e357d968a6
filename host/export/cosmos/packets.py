"""OpenC3 COSMOS command and telemetry definitions from an interface: files of ``cmd_tlm``.

Each telemetry frame has a command ``REQUEST_…``. ``cosmos`` defines the bytes on the line: answers
carry no ID, so the target's interface must tell COSMOS which packet it requested. ``definitions``
defines answers with an ID before them (``host.export.answers``), for the plug-in's own protocol.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import chain

import numpy as np

from cubestack.firmware_model.interface.codec.field import Field, Severity
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind
from cubestack.host.export.answers import answers, requested
from cubestack.host.export.field_text import field_details

TYPES = {"bool1": "UINT", "u8": "UINT", "u16": "UINT", "u32": "UINT", "enum8": "UINT"}
TYPES |= {"i16": "INT", "f32": "FLOAT"}

ID_BITS = 8

_COLOURS = {Severity.STATE: "GREEN", Severity.NOTICE: "YELLOW", Severity.FAULT: "RED"}
"""Of flags that are set."""

#: Of the ID in a plug-in's packets; a field may be called ID.
ID_NAME = "PACKET_ID"

#: A limit that no float32 reaches.
BEYOND_F32 = 3.5e38


def cosmos(interface: Interface) -> str:
    """One file with all packets, as they are on the line."""
    packets: list[Iterator[str]] = []
    for message in interface.messages:
        if message.kind is MessageKind.TELEMETRY:
            request, answer = _request(interface, message, "ID"), _telemetry(interface, message)
            packets += [chain(request, answer)]
        else:
            packets += [_command(interface, message, "ID")]
    return _file(interface, packets)


def definitions(interface: Interface) -> dict[str, str]:
    """Texts of the files ``cmd.txt`` and ``tlm.txt``; answers have an ID, limits and colours."""
    commands = [_command(interface, message, ID_NAME) for message in interface.telecommands]
    commands += [_request(interface, message, ID_NAME) for message in requested(interface)]
    telemetry = [_answer(interface, message) for message in answers(interface)]
    return {"cmd.txt": _file(interface, commands), "tlm.txt": _file(interface, telemetry)}


def _file(interface: Interface, packets: Iterable[Iterable[str]]) -> str:
    lines = [f"# {interface.name}, interface version {interface.version}."]
    for packet in packets:
        lines += ["", *packet]
    return "\n".join(lines) + "\n"


def _request(interface: Interface, message: Message, id_name: str) -> Iterator[str]:
    name = f"REQUEST_{message.name}"
    yield _packet("COMMAND", interface, name, f"Request {message.name}")
    yield _id_parameter(message, id_name)


def _command(interface: Interface, message: Message, id_name: str) -> Iterator[str]:
    yield _packet("COMMAND", interface, message.name, message.meaning)
    if message.risk:
        yield f"  HAZARDOUS {_quoted(message.risk)}"
    yield _id_parameter(message, id_name)
    for field in message.fields:
        details = f"{_quoted(field_details(field))} {_endian(field)}"
        yield f"  PARAMETER {_place(field, ID_BITS)} {_range(field)} {details}"
        if field.scale != 1:
            yield from _counts(field)
        yield from _units_and_states(field)


def _telemetry(interface: Interface, message: Message) -> Iterator[str]:
    yield _packet("TELEMETRY", interface, message.name, message.meaning)
    for field in message.fields:
        yield from _item(field, 0)
        yield from _units_and_states(field)


def _answer(interface: Interface, message: Message) -> Iterator[str]:
    yield _packet("TELEMETRY", interface, message.name, message.meaning)
    about = '"ID of the requested telemetry; 0: acknowledge"'
    yield f"  ID_ITEM {ID_NAME} 0 {ID_BITS} UINT {message.id} {about} LITTLE_ENDIAN"
    for field in message.fields:
        yield from _item(field, ID_BITS)
        if field.flag:
            yield "    STATE FALSE 0 GREEN"
            yield f"    STATE TRUE 1 {_COLOURS[field.severity]}"
        elif field.choices is interface.ack_errors:
            for choice in interface.ack_errors:
                yield f"    STATE {choice.name} {int(choice)} {'RED' if choice else 'GREEN'}"
        else:
            yield from _units_and_states(field)
            yield from _limits(field)


def _packet(keyword: str, interface: Interface, name: str, about: str) -> str:
    return f"{keyword} {interface.name.upper()} {name.upper()} LITTLE_ENDIAN {_quoted(about)}"


def _item(field: Field, header_bits: int) -> Iterator[str]:
    details = f"{_quoted(field_details(field))} {_endian(field)}"
    yield f"  ITEM {_place(field, header_bits)} {details}"
    if field.scale != 1:
        yield f"    POLY_READ_CONVERSION 0 {1 / field.scale!r}"


def _id_parameter(message: Message, name: str) -> str:
    number = f"{message.id} {message.id} {message.id}"
    return f'  ID_PARAMETER {name} 0 {ID_BITS} UINT {number} "ID" LITTLE_ENDIAN'


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
    if field.type == "f32":
        ends = ["MIN", "MAX"]
    else:
        ends = [f"{count / field.scale:.10g}" for count in field.raw_range]
    if field.also is None:  # else it may be beyond the limits, which COSMOS cannot express
        limits = zip(field.ends, (min, max), ends, strict=True)
        ends = [end if one is None else _allowed(field, one, far) for one, far, end in limits]
    return f"{ends[0]} {ends[1]} {float(field.reset or 0):.10g}"


def _allowed(field: Field, limit: float, farther: Callable[..., float]) -> str:
    """The limit, or where a float32 carries it if that is beyond."""
    carried = float(np.float32(limit))
    if field.type == "f32" and farther(limit, carried) != limit:
        return repr(carried)
    return f"{limit:.10g}"


def _counts(field: Field) -> Iterator[str]:
    """The parameter's counts; COSMOS drops what is behind the point, so a half rounds them."""
    scale = f"{field.scale:.17g}"
    if field.raw_range[0] < 0:
        yield f"    SEG_POLY_WRITE_CONVERSION {field.raw_range[0]} -0.5 {scale}"
        yield f"    SEG_POLY_WRITE_CONVERSION 0 0.5 {scale}"
    else:
        yield f"    POLY_WRITE_CONVERSION 0.5 {scale}"


def _limits(field: Field) -> Iterator[str]:
    """Red where the table does not allow the value; what equals a limit of COSMOS is outside."""
    low, high = field.low, field.high
    if field.choices or field.also is not None or not (math.isfinite(low) or math.isfinite(high)):
        return
    if field.type == "f32":
        ends = np.nextafter(np.float32(low), -np.inf), np.nextafter(np.float32(high), np.inf)
        least, largest = (repr(max(-BEYOND_F32, min(float(end), BEYOND_F32))) for end in ends)
    else:
        counts = zip((low, high), field.raw_range, (-0.5, 0.5), strict=True)
        least, largest = (
            f"{(limit if math.isfinite(limit) else raw / field.scale) + half / field.scale:.10g}"
            for limit, raw, half in counts
        )
    yield f"    LIMITS DEFAULT 1 ENABLED {least} {least} {largest} {largest}"


def _units_and_states(field: Field) -> Iterator[str]:
    if field.unit:
        yield f"    UNITS {_quoted(field.unit)} {_quoted(field.unit)}"
    for choice in field.choices or ():
        yield f"    STATE {choice.name} {int(choice)}"


def _quoted(text: str) -> str:
    plain = text.replace('"', "'")
    return f'"{plain}"'
