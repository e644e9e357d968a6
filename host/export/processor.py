"""Renders a processor's registers and pin connections: table, Markdown, JSON, C header."""

import json
from collections.abc import Iterator

from cubestack.firmware_model.interface.efm32gg.c_header import c_header
from cubestack.firmware_model.interface.efm32gg.table import Processor, Register, RegisterField


def render_processor(tables: Processor, format_name: str) -> str:
    """The tables in one of the formats of ``export.interface``."""
    return _FORMATS[format_name](tables)


def processor_header(tables: Processor) -> str:
    head, end, _ = c_header(tables.layouts).rpartition("#endif\n")
    return f"{head}{tables.pins_header()}\n{end}"


def _rows(tables: Processor) -> Iterator[tuple[str, int, Register, bool]]:
    """Peripheral, address, register, and whether it is modelled, by address."""
    rows = (
        (instance.name, instance.base + register.offset, register, layout.modelled)
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
    for owner, address, register, modelled in _rows(tables):
        fields = " ".join(_bits(field) for field in register.fields if field.name)
        kept = "" if modelled and register.modelled else "  (only kept)"
        name = f"{owner}.{register.name}"
        start = f"{address:08X} {name:24} {_access(register):2} {register.reset:08X}"
        lines.append(f"{start} {fields}{kept}".rstrip())
    pins = [line.removeprefix("#define ") for line in tables.pins_header().splitlines()]
    return "\n".join([*lines, *pins]) + "\n"


def _markdown(tables: Processor) -> str:
    lines = ["| address | register | access | reset | fields |", "|---|---|---|---|---|"]
    for owner, address, register, _modelled in _rows(tables):
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
            "modelled": modelled and register.modelled,
            "fields": [
                {"name": one.name, "lsb": one.lsb, "width": one.width}
                | {"readable": one.readable, "writable": one.writable}
                for one in register.fields
            ],
        }
        for owner, address, register, modelled in _rows(tables)
    ]
    return json.dumps({"name": tables.name, "registers": registers}, indent=1) + "\n"


_FORMATS = {"table": _table, "markdown": _markdown, "json": _json}
