"""The register tables as a C++ header for the simulator's peripherals."""

from collections.abc import Iterable, Iterator

from cubestack.firmware_model.interface.efm32gg.pins import LOCATIONS, ROUTES
from cubestack.firmware_model.interface.efm32gg.table import Instance, Layout, Register

_TYPES = """\
// Generated from the register tables; do not edit.
#pragma once

#include <cstdint>

namespace efm32gg {

struct Register {
    uint32_t offset, reset, readable, writable;
    bool action, modelled;
    uint32_t busy;  // its bit in SYNCBUSY; 0: writes take effect at once
    const char *name;
};

struct Layout {
    const char *name;
    const Register *registers;
    int32_t count;
    uint32_t size;
    int32_t if_, ifs, ifc, ien, freeze, syncbusy, cmd;  // offsets, or -1
};

struct Instance {
    const char *name;
    const Layout *layout;
    uint32_t base;
    int32_t lines[4];  // interrupt numbers, or -1
    int32_t index;     // within the layout
};
"""


def cxx_header(layouts: Iterable[Layout]) -> str:
    """A namespace per layout with offsets and masks, and tables of descriptions."""
    layouts = list(layouts)
    parts = [_TYPES]
    for layout in layouts:
        parts.append("\n".join(_namespace(layout)))
    parts.append("\n".join(_tables(layouts)))
    parts.append("\n".join(_routes()))
    parts.append("}  // namespace efm32gg\n")
    return "\n".join(parts)


def _namespace(layout: Layout) -> Iterator[str]:
    yield f"// {layout.title}"
    yield f"namespace {layout.name.lower()} {{"
    yield "enum : uint32_t {"
    for register in layout.registers:
        yield f"    {register.name} = 0x{register.offset:X},"
    yield "};"
    yield "enum : uint32_t {"
    for register in layout.registers:
        for field in register.fields:
            if field.name:
                yield f"    {register.name}_{field.name} = 0x{field.mask:X}u,"
    yield "};"
    yield f"}}  // namespace {layout.name.lower()}\n"


def _tables(layouts: list[Layout]) -> Iterator[str]:
    for layout in layouts:
        yield f"inline const Register {layout.name}_REGISTERS[] = {{"
        busy = {
            field.name: field.mask
            for register in layout.registers
            if register.name == "SYNCBUSY"
            for field in register.fields
        }
        yield from (
            f"    {_register(register, busy.get(register.name, 0))},"
            for register in layout.registers
        )
        yield "};"
        names = ("IF", "IFS", "IFC", "IEN", "FREEZE", "SYNCBUSY", "CMD")
        offsets = (_offset(layout, name) for name in names)
        yield (
            f'inline const Layout {layout.name}_LAYOUT = {{"{layout.name}", '
            f"{layout.name}_REGISTERS, {len(layout.registers)}, 0x{layout.size:X}, "
            f"{', '.join(map(str, offsets))}}};"
        )
    yield "namespace instance {"
    for layout in layouts:
        for index, instance in enumerate(layout.instances):
            yield (
                f"inline const Instance {instance.name} = "
                f'{{"{instance.name}", &{layout.name}_LAYOUT, 0x{instance.base:X}, '
                f"{{{', '.join(map(str, _lines(instance)))}}}, {index}}};"
            )
    yield "}  // namespace instance"
    yield "inline const Instance *const INSTANCES[] = {"
    for layout in layouts:
        yield from (f"    &instance::{instance.name}," for instance in layout.instances)
    yield "};"


def _routes() -> Iterator[str]:
    yield "// Pins of the signals by location, port * 16 + bit; -1: none."
    yield f"constexpr int32_t LOCATIONS = {LOCATIONS};"
    yield "namespace route {"
    yield f"enum Signal : int32_t {{ {', '.join(ROUTES)}, COUNT }};"
    yield "}  // namespace route"
    yield "inline const int8_t ROUTES[][LOCATIONS] = {"
    for pins in ROUTES.values():
        yield f"    {{{', '.join(map(str, [*pins, *[-1] * LOCATIONS][:LOCATIONS]))}}},"
    yield "};"


def _register(register: Register, busy: int) -> str:
    return (
        f"{{0x{register.offset:X}, 0x{register.reset:X}, 0x{register.readable:X}, "
        f"0x{register.writable:X}, {_bool(register.action)}, {_bool(register.modelled)}, "
        f'0x{busy:X}, "{register.name}"}}'
    )


def _bool(value: bool) -> str:
    return "true" if value else "false"


def _offset(layout: Layout, name: str) -> int:
    return next((r.offset for r in layout.registers if r.name == name), -1)


def _lines(instance: Instance) -> list[int]:
    return [*instance.interrupts.values(), -1, -1, -1, -1][:4]
