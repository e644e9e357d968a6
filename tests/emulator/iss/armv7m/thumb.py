"""Assembles small Thumb programs, so that most tests need no tool chain.

Encodings: ARMv7-M Architecture Reference Manual (DDI 0403), A7.7, as far as tests need them. Labels
are resolved when the program is complete.
"""

import struct

UNEXPECTED = 0xFF00
"""Address of vectors without a handler: a BKPT, which ends in a lock-up."""


class Program:
    """A 64 kB memory at address 0: vectors, then the code that the methods append.

    Methods for instructions have the names of the mnemonics and return the instruction's address.
    """

    def __init__(self, stack: int = 0x2000_8000, start: int = 0x400) -> None:
        self.image = bytearray(b"\x00\xbe" * 0x8000)  # BKPT wherever nothing was written
        self.image[:0x400] = struct.pack("<I", UNEXPECTED | 1) * 0x100
        self.at = start
        self.labels: dict[str, int] = {}
        self._branches: list[tuple[int, str, int]] = []
        self.vector(0, stack)
        self.vector(1, start | 1)

    def vector(self, exception: int, value: int) -> None:
        struct.pack_into("<I", self.image, 4 * exception, value)

    def handler(self, exception: int, at: int | None = None) -> int:
        """Begin the exception's handler, at the current address or ``at``."""
        self.at = self.at if at is None else at
        self.vector(exception, self.at | 1)
        return self.at

    def half(self, *halves: int) -> int:
        address = self.at
        for value in halves:
            struct.pack_into("<H", self.image, self.at, value)
            self.at += 2
        return address

    def label(self, name: str) -> int:
        self.labels[name] = self.at
        return self.at

    def finish(self) -> bytes:
        """Resolve branches and return the image."""
        for address, name, condition in self._branches:
            offset = self.labels[name] - (address + 4)
            if condition == 14:
                value = 0xE000 | (offset >> 1) & 0x7FF
            else:
                value = 0xD000 | condition << 8 | (offset >> 1) & 0xFF
            struct.pack_into("<H", self.image, address, value)
        self._branches.clear()
        return bytes(self.image)

    def load(self, register: int, value: int) -> int:
        """Load any constant, by MOVW and MOVT."""
        address = self.at
        for opcode, part in ((0xF240, value & 0xFFFF), (0xF2C0, value >> 16)):
            i, imm3, imm4 = part >> 11 & 1, part >> 8 & 7, part >> 12
            self.half(opcode | i << 10 | imm4, imm3 << 12 | register << 8 | part & 0xFF)
        return address

    def movs(self, register: int, value: int) -> int:
        return self.half(0x2000 | register << 8 | value)

    def adds(self, register: int, value: int) -> int:
        return self.half(0x3000 | register << 8 | value)

    def udiv(self, to: int, dividend: int, divisor: int) -> int:
        return self.half(0xFBB0 | dividend, 0xF0F0 | to << 8 | divisor)

    def ldr(self, register: int, base: int, offset: int = 0) -> int:
        return self.half(0x6800 | offset >> 2 << 6 | base << 3 | register)

    def str(self, register: int, base: int, offset: int = 0) -> int:
        return self.half(0x6000 | offset >> 2 << 6 | base << 3 | register)

    def strb(self, register: int, base: int) -> int:
        return self.half(0x7000 | base << 3 | register)

    def push(self, *registers: int) -> int:
        """Low registers and LR (14)."""
        return self.half(0xB400 | sum(1 << min(register, 8) for register in registers))

    def b(self, name: str, condition: int = 14) -> int:
        """Branch; ``condition`` is the number in the encoding (0 EQ, 1 NE, 14 always)."""
        self._branches.append((self.at, name, condition))
        return self.half(0)

    def bx(self, register: int = 14) -> int:
        return self.half(0x4700 | register << 3)

    def forever(self) -> int:
        """Branch to itself."""
        return self.half(0xE7FE)

    def nop(self, count: int = 1) -> int:
        return self.half(*[0xBF00] * count)

    def svc(self, number: int = 0) -> int:
        return self.half(0xDF00 | number)

    def bkpt(self, number: int = 0) -> int:
        return self.half(0xBE00 | number)

    def wfi(self) -> int:
        return self.half(0xBF30)

    def wfe(self) -> int:
        return self.half(0xBF20)

    def sev(self) -> int:
        return self.half(0xBF40)

    def cps(self, enable: bool, fault: bool = False) -> int:
        """CPSIE or CPSID, of PRIMASK or FAULTMASK."""
        return self.half(0xB660 | (not enable) << 4 | (1 if fault else 2))

    def msr(self, special: str, register: int) -> int:
        return self.half(0xF380 | register, 0x8800 | _SPECIAL[special])

    def mrs(self, register: int, special: str) -> int:
        return self.half(0xF3EF, 0x8000 | register << 8 | _SPECIAL[special])

    def poke(self, address: int, value: int, by: tuple[int, int] = (6, 7)) -> int:
        """Store a constant at an address; uses two registers."""
        self.load(by[0], address)
        self.load(by[1], value)
        return self.str(by[1], by[0])


_SPECIAL = {"msp": 8, "psp": 9, "primask": 16, "basepri": 17, "faultmask": 19, "control": 20}
