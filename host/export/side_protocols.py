"""Exports of a device's protocols besides the node protocol.

Register-pointer protocol on I2C and one-letter requests on a serial line; empty for a device
without them.
"""

from collections.abc import Iterator

from cubestack.firmware_model.interface.codec.letters import Letter, LetterProtocol
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.codec.register_pointer import FILL, PointerMap
from cubestack.host.export.field_text import field_details, field_json, field_type, picked

_UART = (
    "On a UART: the I2C address with the direction in its lowest bit (1 reads), the register's "
    "address, and a data byte or the answer; where there is nothing, no answer. "
)


def side_table(interface: Interface) -> Iterator[str]:
    if interface.registers is not None:
        yield from ("", f"REGISTERS at {_address(interface.registers)}  (address, access, type)")
        if interface.registers.note:
            yield f"  {interface.registers.note}"
        for register in interface.registers:
            yield (
                f"  {register.address:#04x} {register.access.value} "
                f"{field_type(register.field):<13} {register.name:<20} "
                f"{field_details(register.field)}"
            )
    if interface.service_port is not None:
        yield from ("", f"BENCH LETTERS at {_line(interface.service_port)}")
        for letter in interface.service_port.letters:
            yield f"  {letter.letter} {letter.name:<14} {letter.meaning}; answer: {_answer(letter)}"


def side_markdown(interface: Interface) -> Iterator[str]:
    if interface.registers is not None:
        yield from (
            "",
            "## Registers",
            "",
            f"At {_address(interface.registers)}. Write a register's address and either one data "
            "byte, or read the value behind a repeated start or in a transfer of its own. Two "
            "bytes are signed, the most significant first. Writing the address latches the value; "
            "a read without it continues where the last one stopped. Where there is nothing, "
            f"{FILL:#04x} is read. What can not or must not be written is ignored. "
            f"{_UART * (interface.registers.baud is not None)}{interface.registers.note}",
            "",
            "| address | access | type | register | meaning |",
            "|-|-|-|-|-|",
        )
        for register in interface.registers:
            yield (
                f"| {register.address:#04x} | {register.access.value} | "
                f"{field_type(register.field)} | {register.name} | "
                f"{field_details(register.field)} |"
            )
    if interface.service_port is not None:
        yield from (
            "",
            "## Bench letters",
            "",
            f"At {_line(interface.service_port)}. One byte is a request; others get no answer.",
            "",
            "| letter | name | meaning | answer |",
            "|-|-|-|-|",
        )
        for letter in interface.service_port.letters:
            yield f"| {letter.letter} | {letter.name} | {letter.meaning} | {_answer(letter)} |"


def side_json(interface: Interface) -> dict[str, object]:
    content: dict[str, object] = {}
    if interface.registers is not None:
        content["registers"] = {
            **picked(interface.registers, "i2c_address", "note", "baud"),
            "registers": [
                {
                    "address": register.address,
                    "access": register.access.value,
                    "length": register.length,
                    "field": field_json(register.field),
                }
                for register in interface.registers
            ],
        }
    if interface.service_port is not None:
        content["bench"] = {
            "baud": interface.service_port.baud,
            "letters": [
                {
                    **picked(letter, "letter", "name", "meaning", "length"),
                    "answer": None if letter.answer is None else letter.answer.hex(),
                }
                for letter in interface.service_port.letters
            ],
        }
    return content


def side_c(interface: Interface) -> Iterator[str]:
    upper = interface.name.upper()
    if interface.registers is not None:
        yield from ("", "/* Registers; two bytes are signed, the most significant first. */")
        yield f"#define {upper}_REGISTER_I2C_ADDRESS 0x{interface.registers.i2c_address:02X}"
        if interface.registers.baud is not None:
            yield f"#define {upper}_REGISTER_BAUD {interface.registers.baud}"
        for register in interface.registers:
            name, field = f"{upper}_REGISTER_{register.name}", register.field
            unit = f" [{field.unit}]" if field.unit else ""
            yield f"#define {name} 0x{register.address:02X} /* {field.meaning}{unit} */"
            yield f"#define {name}_LENGTH {register.length}"
            if field.scale != 1:
                yield f"#define {name}_SCALE {field.scale:g}"
    if interface.service_port is not None:
        yield from ("", "/* Letters on the bench's serial line. */")
        yield f"#define {upper}_BENCH_BAUD {interface.service_port.baud}"
        for letter in interface.service_port.letters:
            name = f"{upper}_BENCH_{letter.name}"
            yield f"#define {name} '{letter.letter}' /* {letter.meaning} */"
            yield f"#define {name}_LENGTH {letter.length}"


def _address(registers: PointerMap) -> str:
    line = "" if registers.baud is None else f", or on a UART at {registers.baud} baud 8N1"
    return f"I2C address {registers.i2c_address:#04x} (7 bits){line}"


def _line(protocol: LetterProtocol) -> str:
    return f"{protocol.baud} baud 8N1"


def _answer(letter: Letter) -> str:
    if letter.answer is None:
        return f"{letter.length} bytes"
    return f"'{letter.answer.decode('ascii')}'"
