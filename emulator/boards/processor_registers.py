"""Reads registers of a running part by their names, for a debugger."""

from typing import NamedTuple

from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.table import Instance, Layout

WORD = 4


class RegisterValue(NamedTuple):
    """A word of memory and its fields; ``value`` is None if it can not be read."""

    name: str
    value: int | None
    fields: dict[str, int]

    @property
    def text(self) -> str:
        if self.value is None:
            return "can not be read"
        shown = (f"{name}={value:#x}" for name, value in self.fields.items() if value)
        return f"{self.value:08x} {' '.join(shown)}".rstrip()


def peripherals() -> list[str]:
    return [instance.name for layout in LAYOUTS for instance in layout.instances]


def peek(machine: Machine, symbols: Symbols, what: str) -> list[RegisterValue]:
    """The words of a peripheral, a register (``CMU.CTRL``), a variable or an address.

    Raises ValueError for anything else.
    """
    unit, _, name = what.upper().partition(".")
    if unit in peripherals():
        return _registers(machine, *find_instance(unit), name)
    variable = symbols.variables.get(what)
    if variable is not None:
        words = range(variable.address & -WORD, variable.address + variable.size, WORD)
        return [_word(machine, address, what) for address in words]
    try:
        address = int(what, 0)
    except ValueError:
        known = ", ".join(peripherals())
        raise ValueError(f"no peripheral, variable or address {what!r}; known: {known}") from None
    return [_word(machine, address & 0xFFFF_FFFC, "")]


def find_instance(unit: str) -> tuple[Layout, Instance]:
    return next(
        (layout, instance)
        for layout in LAYOUTS
        for instance in layout.instances
        if instance.name == unit
    )


def _registers(
    machine: Machine, layout: Layout, instance: Instance, name: str
) -> list[RegisterValue]:
    found = [one for one in layout.registers if name in ("", one.name)]
    if not found:
        known = ", ".join(one.name for one in layout.registers)
        raise ValueError(f"{instance.name} has no register {name}; known: {known}")
    values = []
    for register in found:
        value = _value(machine, instance.base + register.offset)
        fields = {
            bits.name: (value & bits.mask) >> bits.lsb
            for bits in register.fields
            if bits.name and value is not None
        }
        values.append(RegisterValue(f"{instance.name}.{register.name}", value, fields))
    return values


def _word(machine: Machine, address: int, name: str) -> RegisterValue:
    return RegisterValue(f"{name} {address:08x}".lstrip(), _value(machine, address), {})


def _value(machine: Machine, address: int) -> int | None:
    data = machine.peek(address, WORD)
    return int.from_bytes(data, "little") if len(data) == WORD else None
