"""Assembles small Thumb programs, so that most tests need no tool chain.

A program is a text of instructions separated by ``;``, in the syntax of the ARMv7-M Architecture
Reference Manual (DDI 0403), A7.7, as far as tests need them. Beside these:

- ``label:`` names an address, ``@16:`` begins the handler of exception 16;
- ``b .`` branches to itself, ``ldr r0, =N`` loads any constant by MOVW and MOVT;
- ``nop #N`` is N of them, ``.short N, N`` half-words; ``.org N`` continues at an address.
"""

import re
import struct

START = 0x400
UNEXPECTED = 0xFF00
"""Address of vectors without a handler: a BKPT, which ends in a lock-up."""

_NUMBERS = {f"r{n}": n for n in range(13)} | {
    "lr": 14, "msp": 8, "psp": 9, "primask": 16, "basepri": 17, "faultmask": 19, "control": 20,
}  # fmt: skip
_OPERAND = re.compile(rf"\b({'|'.join(_NUMBERS)})\b|[#=]\w+")
_CONDITIONS = {"b": 14, "beq": 0, "bne": 1}


def constant(register: int, value: int) -> list[int]:
    """MOVW and MOVT of a register."""
    halves = []
    for opcode, part in ((0xF240, value & 0xFFFF), (0xF2C0, value >> 16)):
        halves.append(opcode | (part >> 11 & 1) << 10 | part >> 12)
        halves.append((part >> 8 & 7) << 12 | register << 8 | part & 0xFF)
    return halves


_FORMS = {
    "adds R, #": lambda d, value: [0x3000 | d << 8 | value],
    "b .": lambda: [0xE7FE],
    "bkpt #": lambda number: [0xBE00 | number],
    "bx R": lambda m: [0x4700 | m << 3],
    "cmp R, #": lambda n, value: [0x2800 | n << 8 | value],
    "cpsid f": lambda: [0xB671],
    "cpsid i": lambda: [0xB672],
    "cpsie i": lambda: [0xB662],
    "isb": lambda: [0xF3BF, 0x8F6F],
    "ldr R, =": constant,
    "ldr R, [R]": lambda t, n: [0x6800 | n << 3 | t],
    "ldr R, [sp, #]": lambda t, offset: [0x9800 | t << 8 | offset >> 2],
    "movs R, #": lambda d, value: [0x2000 | d << 8 | value],
    "mrs R, R": lambda d, special: [0xF3EF, 0x8000 | d << 8 | special],
    "msr R, R": lambda special, n: [0xF380 | n, 0x8800 | special],
    "nop": lambda: [0xBF00],
    "nop #": lambda count: [0xBF00] * count,
    "sev": lambda: [0xBF40],
    "str R, [R]": lambda t, n: [0x6000 | n << 3 | t],
    "str R, [sp, #]": lambda t, offset: [0x9000 | t << 8 | offset >> 2],
    "strb R, [R]": lambda t, n: [0x7000 | n << 3 | t],
    "svc #": lambda number: [0xDF00 | number],
    "udf #": lambda number: [0xDE00 | number],
    "udiv R, R, R": lambda d, n, m: [0xFBB0 | n, 0xF0F0 | d << 8 | m],
    "wfe": lambda: [0xBF20],
    "wfi": lambda: [0xBF30],
}
"""Encodings by form: R is a register, # and = are constants."""


def store(address: int, value: int) -> str:
    """Instructions that store a constant; they use r0 and r1."""
    return f"ldr r0, ={address}; ldr r1, ={value}; str r1, [r0]"


class Program:
    """A 64 kB memory at address 0: vectors, and the code from ``START`` on."""

    def __init__(self, text: str = "", stack: int = 0x2000_8000) -> None:
        self.image = bytearray(b"\x00\xbe" * 0x8000)  # BKPT wherever nothing was written
        self.image[:START] = struct.pack("<I", UNEXPECTED | 1) * (START // 4)
        self.labels: dict[str, int] = {}
        self._at = START
        self._branches: list[tuple[int, int, str]] = []
        struct.pack_into("<2I", self.image, 0, stack, START | 1)
        for statement in text.split(";"):
            self._write(statement.strip())
        for address, condition, name in self._branches:
            offset = self.labels[name] - (address + 4) >> 1
            if condition == 14:
                half = 0xE000 | offset & 0x7FF
            else:
                half = 0xD000 | condition << 8 | offset & 0xFF
            struct.pack_into("<H", self.image, address, half)

    def _write(self, statement: str) -> None:
        while mark := re.match(r"(@?)(\w+):\s*", statement):
            if mark[1]:
                struct.pack_into("<I", self.image, 4 * int(mark[2]), self._at | 1)
            else:
                self.labels[mark[2]] = self._at
            statement = statement[mark.end() :]
        mnemonic, _, operands = statement.partition(" ")
        if mnemonic == ".org":
            self._at = int(operands, 0)
        elif mnemonic in _CONDITIONS and operands != ".":
            self._branches.append((self._at, _CONDITIONS[mnemonic], operands))
            self._at += 2
        elif statement:
            halves = [int(one, 0) for one in operands.split(",")] if mnemonic == ".short" else None
            for half in _encode(statement) if halves is None else halves:
                struct.pack_into("<H", self.image, self._at, half)
                self._at += 2


def _encode(instruction: str) -> list[int]:
    values = []

    def note(operand: re.Match[str]) -> str:
        text = operand[0]
        values.append(_NUMBERS[text] if text in _NUMBERS else int(text[1:], 0))
        return "R" if text in _NUMBERS else text[0]

    return _FORMS[_OPERAND.sub(note, instruction)](*values)
