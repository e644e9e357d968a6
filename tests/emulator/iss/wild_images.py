"""Images of random bytes, random instructions and random accesses."""

import random
import struct
from collections.abc import Callable

from cubestack.firmware_model.interface.efm32gg import LAYOUTS

from .armv7m.thumb import constant

STACK = 0x2000_8000
START = 0x400
INTERESTING = (
    0x0000_0000, 0x0000_0400, 0x000F_FFFC, 0x0010_0000, 0x0FE0_81E0, 0x1FFF_FFFE, 0x2000_0000,
    0x2001_FFFE, 0x2002_0000, 0x21FF_FFFF, 0x2200_0000, 0x23FF_FFFC, 0x3FFF_FFFF, 0x4200_0000,
    0x43FF_FFFC, 0x5FFF_FFFF, 0x8000_0000, 0x9FFF_FFFF, 0xA000_0000, 0xE000_0000, 0xE000_1000,
    0xE000_2000, 0xE000_ED00, 0xE004_0000, 0xE00F_F000, 0xF000_0000, 0xFFFF_FFF0, 0xFFFF_FFFF,
)  # fmt: skip

REGISTERS = [
    instance.base + register.offset
    for layout in LAYOUTS
    for instance in layout.instances
    for register in layout.registers
]


def _vectors(chance: random.Random, start: int = START) -> bytes:
    table = [STACK, start | 1]
    table += [chance.choice((start | 1, chance.getrandbits(17) | 1, 0, chance.getrandbits(32)))
              for _ in range(62)]  # fmt: skip
    return struct.pack("<64I", *table).ljust(START, b"\xff")


def address(chance: random.Random) -> int:
    """A random address, most often of a register."""
    kind = chance.random()
    if kind < 0.6:
        return chance.choice(REGISTERS)
    if kind < 0.65:
        return 0x4000_0000 | chance.getrandbits(20) & 0xFFFFC
    if kind < 0.72:
        return 0xE000_E000 | chance.getrandbits(12) & 0xFFC
    if kind < 0.75:
        return 0xE000_0000 | chance.getrandbits(20)
    if kind < 0.8:
        return 0x2000_0000 | chance.getrandbits(17)
    if kind < 0.9:
        return chance.choice(INTERESTING)
    return chance.getrandbits(32)


def _constant(register: int, value: int) -> bytes:
    return struct.pack("<4H", *constant(register, value))


def noise(chance: random.Random) -> bytes:
    """Random bytes, also as vector table."""
    return chance.randbytes(0x4000)


def noise_that_starts(chance: random.Random) -> bytes:
    """Random bytes after a valid vector table."""
    return _vectors(chance) + chance.randbytes(0x8000)


def short_instructions(chance: random.Random) -> bytes:
    """16-bit instructions with few branches, so that many are executed."""
    halves = []
    for _ in range(0x2000):
        half = chance.getrandbits(16)
        while half >= 0xE800 or (0xD000 <= half < 0xE800 and chance.random() < 0.9):
            half = chance.getrandbits(16)
        halves.append(half)
    return _vectors(chance) + struct.pack("<8192H", *halves)


STORES = 0x6001, 0x8001, 0x7001  # STR, STRH, STRB r1, [r0]
LOADS = 0x6802, 0x8802, 0x7802
OTHERS = 0xBF30, 0xBF20, 0xBF40, 0xDF00, 0xB662, 0xBE00  # WFI, WFE, SEV, SVC, CPSIE, BKPT
SKIP = bytes.fromhex("0698023006907047")
"""A handler that returns to two bytes after the faulting instruction."""


def _program(chance: random.Random, code: bytes) -> bytes:
    """The code, then a branch to itself; most often with handlers that continue after a fault."""
    image = bytearray(_vectors(chance) + code + struct.pack("<H", 0xE7FE))
    if chance.random() < 0.8:
        handler = len(image) + 2 & ~3
        struct.pack_into("<62I", image, 8, *[handler | 1] * 62)
        image[handler:] = SKIP
    return bytes(image)


def _access(chance: random.Random, where: int) -> bytes:
    value = chance.choice((0, 1, 0xFFFF_FFFF, 1 << chance.randrange(32), chance.getrandbits(32),
                           chance.getrandbits(8), address(chance)))  # fmt: skip
    count = chance.randrange(1, 4)
    halves = [chance.choice(STORES + LOADS + (STORES[0], LOADS[0])) for _ in range(count)]
    if chance.random() < 0.05:
        halves.append(chance.choice(OTHERS))
    return _constant(0, where) + _constant(1, value) + struct.pack(f"<{len(halves)}H", *halves)


def _delay(chance: random.Random) -> bytes:
    return _constant(3, chance.choice((10, 1000, 10_000))) + struct.pack("<2H", 0x3B01, 0xD1FD)


CLOCKS_ON = b"".join(
    _constant(0, 0x400C_8000 + offset) + _constant(1, value) + struct.pack("<H", 0x6001)
    for offset, value in ((0x40, 7), (0x44, 0xFFFF_FFFF), (0x58, 0xFFFF_FFFF), (0x60, 0xFFFF_FFFF))
)
"""All clocks, except those of the core's bus that would stop a program."""


def one_line_program(code: bytes, asleep: bool) -> bytes:
    """A program that runs this code and then loops or sleeps; faults lead there too."""
    end = (START + len(code)) | 1
    image = struct.pack("<64I", STACK, START | 1, *[end] * 62).ljust(START, b"\xff")
    return image + code + struct.pack("<2H", *((0xBF30, 0xE7FD) if asleep else (0xE7FE, 0xE7FE)))


def accesses(chance: random.Random) -> bytes:
    """Loads and stores of all sizes, of registers and of unused addresses."""
    return _program(chance, b"".join(_access(chance, address(chance)) for _ in range(200)))


def accesses_with_clocks(chance: random.Random) -> bytes:
    """The same with clocks and interrupts enabled."""
    code = CLOCKS_ON + _constant(0, 0xE000_E100) + _constant(1, 0xFFFF_FFFF)
    code += struct.pack("<H", 0x6001)
    return _program(chance, code + b"".join(_access(chance, address(chance)) for _ in range(200)))


def one_peripheral(chance: random.Random) -> bytes:
    """Many accesses of one or two peripherals with clocks enabled and delays between."""
    chosen = [
        instance.base + register.offset
        for layout in chance.sample(LAYOUTS, chance.choice((1, 1, 2)))
        for instance in layout.instances
        for register in layout.registers
    ]
    code = CLOCKS_ON
    if chance.random() < 0.5:
        code += _constant(0, 0xE000_E100) + _constant(1, 0xFFFF_FFFF) + struct.pack("<H", 0x6001)
    for _ in range(300):
        code += _access(chance, chance.choice(chosen))
        if chance.random() < 0.1:
            code += _delay(chance)
    return _program(chance, code)


_MAKERS = (noise, noise_that_starts, short_instructions, accesses, accesses_with_clocks,
           one_peripheral)  # fmt: skip
KINDS: dict[str, Callable[[random.Random], bytes]] = {each.__name__: each for each in _MAKERS}
