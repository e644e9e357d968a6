"""The register tables as a plain C header, for firmware: structures, masks and shifts.

``USART1->CTRL = USART_CTRL_SYNC;`` A mask of several bits has its shift beside it, NAME_SHIFT.
"""

from collections.abc import Iterable, Iterator

from cubestack.firmware_model.interface.efm32gg.table import Layout, Register

_TOP = """\
/* Registers of the EFM32GG280F1024, generated from the register tables; do not edit. */
#ifndef EFM32GG_REGISTERS_H
#define EFM32GG_REGISTERS_H

#include <stdint.h>

"""


def c_header(layouts: Iterable[Layout]) -> str:
    layouts = list(layouts)
    lines: list[str] = []
    for layout in layouts:
        lines += [f"/* {layout.title} */", *_structure(layout), *_masks(layout)]
        lines += [
            f"#define {instance.name} (({layout.name}_Registers *)0x{instance.base:08X}u)"
            for instance in layout.instances
        ]
        lines.append("")
    return _TOP + "\n".join([*lines, *_interrupts(layouts), "", "#endif", ""])


def _structure(layout: Layout) -> Iterator[str]:
    yield "typedef struct {"
    at = 0
    for register in layout.registers:
        if register.offset > at:
            yield f"    uint32_t reserved_{at:X}[{(register.offset - at) // 4}];"
        yield f"    {_qualifier(register)} uint32_t {register.name};"
        at = register.offset + 4
    yield f"}} {layout.name}_Registers;"


def _qualifier(register: Register) -> str:
    return "volatile" if register.writable else "volatile const"


def _masks(layout: Layout) -> Iterator[str]:
    for register in layout.registers:
        for field in register.fields:
            if not field.name:
                continue
            name = f"{layout.name}_{register.name}_{field.name}"
            yield f"#define {name} 0x{field.mask:08X}u"
            if field.width > 1:
                yield f"#define {name}_SHIFT {field.lsb}"


def _interrupts(layouts: list[Layout]) -> Iterator[str]:
    numbers = {
        number: name
        for layout in layouts
        for instance in layout.instances
        for name, number in instance.interrupts.items()
    }
    yield "/* Interrupt numbers */"
    yield from (f"#define {numbers[number]}_IRQ {number}" for number in sorted(numbers))
