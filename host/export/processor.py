"""A processor's registers and pin connections as table, Markdown, JSON, C header and CMSIS-SVD."""

import json
from collections.abc import Iterator
from xml.etree import ElementTree as Xml

from cubestack.firmware_model.interface.efm32gg.c_header import c_header
from cubestack.firmware_model.interface.efm32gg.table import (
    Instance,
    Layout,
    Processor,
    Register,
    RegisterField,
)


def render_processor(tables: Processor, format_name: str) -> str:
    return _FORMATS[format_name](tables)


def processor_header(tables: Processor) -> str:
    head, end, _ = c_header(tables.layouts).rpartition("#endif\n")
    return f"{head}{tables.pins_header()}\n{end}"


def _rows(tables: Processor) -> Iterator[tuple[str, int, Register]]:
    """Peripheral, address, register, by address."""
    rows = (
        (instance.name, instance.base + register.offset, register)
        for layout in tables.layouts
        for instance in layout.instances
        for register in layout.registers
    )
    yield from sorted(rows, key=lambda row: row[1])


def _bits(field: RegisterField) -> str:
    if field.width == 1:
        return f"{field.name}[{field.lsb}]"
    return f"{field.name}[{field.lsb + field.width - 1}:{field.lsb}]"


def _access(register: Register) -> str:
    return "r" * bool(register.readable) + "w" * bool(register.writable)


def _table(tables: Processor) -> str:
    lines = [f"{tables.name}: address, register, access, value after a reset, fields"]
    for owner, address, register in _rows(tables):
        fields = " ".join(_bits(field) for field in register.fields if field.name)
        kept = "" if register.modelled else "  (only kept)"
        name = f"{owner}.{register.name}"
        start = f"{address:08X} {name:24} {_access(register):2} {register.reset:08X}"
        lines.append(f"{start} {fields}{kept}".rstrip())
    pins = [line.removeprefix("#define ") for line in tables.pins_header().splitlines()]
    return "\n".join([*lines, *pins]) + "\n"


def _markdown(tables: Processor) -> str:
    lines = ["| address | register | access | reset | fields |", "|---|---|---|---|---|"]
    for owner, address, register in _rows(tables):
        fields = " ".join(f"`{_bits(field)}`" for field in register.fields if field.name)
        lines.append(
            f"| {address:08X} | {owner}.{register.name} | {_access(register)} | "
            f"{register.reset:08X} | {fields} |"
        )
    return "\n".join(lines) + "\n"


def _json(tables: Processor) -> str:
    registers = [
        {
            "peripheral": owner,
            "name": register.name,
            "address": address,
            "reset": register.reset,
            "modelled": register.modelled,
            "fields": [
                {"name": one.name, "lsb": one.lsb, "width": one.width}
                | {"readable": one.readable, "writable": one.writable}
                | ({"values": dict(one.values)} if one.values else {})
                for one in register.fields
            ],
        }
        for owner, address, register in _rows(tables)
    ]
    return json.dumps({"name": tables.name, "registers": registers}, indent=1) + "\n"


_FORMATS = {"table": _table, "markdown": _markdown, "json": _json}


WORD_BITS = 32
WORD_BYTES = 4


def svd(tables: Processor) -> str:
    """Text of the document; further instances derive from the first."""
    root = Xml.Element(
        "device",
        {
            "schemaVersion": "1.3",
            "xmlns:xs": "http://www.w3.org/2001/XMLSchema-instance",
            "xs:noNamespaceSchemaLocation": "CMSIS-SVD.xsd",
        },
    )
    _texts(root, name=tables.name, version="1", description=f"{tables.name}, as it is emulated")
    core = tables.core
    _texts(
        Xml.SubElement(root, "cpu"),
        name=core.name,
        revision=core.revision,
        endian="little",
        mpuPresent=str(core.has_mpu).lower(),
        fpuPresent="false",
        nvicPrioBits=core.priority_bits,
        vendorSystickConfig="false",
    )
    _texts(root, addressUnitBits=8, width=WORD_BITS, size=WORD_BITS)
    peripherals = Xml.SubElement(root, "peripherals")
    for layout in tables.layouts:
        for instance in layout.instances:
            _peripheral(peripherals, layout, instance)
    Xml.indent(root)
    return Xml.tostring(root, "unicode", xml_declaration=True) + "\n"


def _peripheral(parent: Xml.Element, layout: Layout, instance: Instance) -> None:
    first = layout.instances[0]
    own = Xml.SubElement(parent, "peripheral")
    if instance is not first:
        own.set("derivedFrom", first.name)
    _texts(own, name=instance.name, description=layout.title, baseAddress=f"{instance.base:#010x}")
    end = max((register.offset for register in layout.registers), default=0) + WORD_BYTES
    _texts(Xml.SubElement(own, "addressBlock"), offset=0, size=f"{end:#x}", usage="registers")
    for name, number in instance.interrupts.items():
        unique = name if name.startswith(instance.name) else f"{instance.name}_{name}"
        _texts(Xml.SubElement(own, "interrupt"), name=unique, value=number)
    if instance is first and layout.registers:
        registers = Xml.SubElement(own, "registers")
        for register in layout.registers:
            _register(registers, register)


def _register(parent: Xml.Element, register: Register) -> None:
    own = Xml.SubElement(parent, "register")
    kept = "" if register.modelled else "; the emulator only keeps it"
    _texts(own, name=register.name, description=f"{register.name}{kept}")
    _texts(own, addressOffset=f"{register.offset:#x}", size=WORD_BITS)
    _texts(own, access=_access_text(bool(register.readable), bool(register.writable)))
    _texts(own, resetValue=f"{register.reset:#010x}")
    if register.action:
        _texts(own, readAction="modifyExternal")
    named = [field for field in register.fields if field.name]
    if named:
        fields = Xml.SubElement(own, "fields")
        for field in named:
            _field(fields, field)


def _field(parent: Xml.Element, field: RegisterField) -> None:
    own = Xml.SubElement(parent, "field")
    _texts(own, name=field.name, bitOffset=field.lsb, bitWidth=field.width)
    _texts(own, access=_access_text(field.readable, field.writable))
    if field.values:
        values = Xml.SubElement(own, "enumeratedValues")
        for number, name in field.values:
            _texts(Xml.SubElement(values, "enumeratedValue"), name=name, value=number)


def _access_text(readable: bool, writable: bool) -> str:
    if readable and writable:
        return "read-write"
    return "write-only" if writable else "read-only"


def _texts(parent: Xml.Element, **values: object) -> None:
    for tag, value in values.items():
        Xml.SubElement(parent, tag).text = str(value)
