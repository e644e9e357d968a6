"""Registers of the system control space: reset values, writable bits, sizes of access (B3.2)."""

import pytest

from .bench import (
    ACTLR,
    AIRCR,
    CCR,
    CFSR,
    DEMCR,
    DFSR,
    DWT,
    ICSR,
    ISPR,
    ITM,
    LOG,
    SCR,
    SHCSR,
    SHPR1,
    SHPR2,
    SHPR3,
    STIR,
    VTOR,
    Bench,
)  # fmt: skip
from .bench import ITM as ITM_BASE
from .thumb import Program

AFTER_RESET_AND_ONES = {
    # address: (value after reset, value after ones were written)
    0xE000E004: (1, 1),  # ICTR
    ACTLR: (0, 7),
    0xE000ED00: (0x412F_C231, 0x412F_C231),  # CPUID
    VTOR: (0, 0x3FFF_FF80),
    AIRCR: (0xFA05_0000, 0xFA05_0000),
    SCR: (0, 0x16),
    CCR: (0x200, 0x31B),
    SHPR1: (0, 0x00E0_E0E0),
    SHPR2: (0, 0xE000_0000),
    SHPR3: (0, 0xE0E0_00E0),
    0xE000ED30: (0, 0),
    0xE000ED40: (0x30, 0x30),  # ID_PFR0
    0xE000ED70: (0x0131_0132, 0x0131_0132),  # ID_ISAR4
    0xE000ED88: (0, 0),  # CPACR: no floating point
    0xE000ED90: (0x800, 0x800),  # MPU_TYPE
    0xE0002000: (0x260, 0x261),  # FP_CTRL: 6 and 2 comparators
    DWT: (0x4000_0000, 0x407F_1FFF),
}


@pytest.mark.parametrize("address", AFTER_RESET_AND_ONES)
def test_register(address):
    bench = Bench()
    reset, ones = AFTER_RESET_AND_ONES[address]
    assert bench.read(address) == bench.peek(address) == reset
    assert bench.write(address, 0xFFFF_FFFF)
    assert bench.read(address) == ones
    bench.reset()
    assert bench.read(address) == reset


def test_what_is_not_there():
    bench = Bench()
    for address in (0xE000_3000, 0xE000_D000, 0xE001_0000, 0xE00A_0000):
        assert bench.read(address) is None
        assert not bench.write(address, 0)
    assert bench.read(0xE004_0000) == 0  # TPIU: reserved, and logged


def test_handler_priorities_and_fault_status_are_accessed_in_bytes_too():
    bench = Bench()
    bench.write(SHPR3 + 2, 0xFF, 1)
    assert bench.read(SHPR3) == 0x00E0_0000
    assert bench.read(SHPR3 + 2, 1) == 0xE0
    assert bench.read(SHPR3 + 2, 2) == 0x00E0
    bench.write(SCR, 0x16, 1)  # others: words only
    assert bench.read(SCR) == 0
    assert bench.read(CFSR + 1, 1) == 0


def test_pending_by_shcsr_and_icsr():
    bench = Bench()
    bench["primask"] = 1
    bench.write(SHCSR, 1 << 15 | 7 << 16)
    assert bench.read(SHCSR) == 1 << 15 | 7 << 16
    assert bench.read(ICSR) >> 12 & 0x1FF == 11
    bench.write(ICSR, 1 << 28)
    assert bench.read(ICSR) >> 28 & 1
    bench.write(ICSR, 1 << 27)
    assert not bench.read(ICSR) >> 28 & 1
    bench.write(STIR, 38)
    assert bench.read(ICSR) >> 22 & 1
    bench.write(STIR, 39)
    assert bench.read(ISPR + 4) == 0x40


def test_unprivileged_code_sees_a_bus_fault():
    bench = Bench()
    bench["control"] = 1
    assert bench.read(ICSR) is None
    assert not bench.write(SCR, 2)
    assert not bench.write(STIR, 1)
    bench["control"] = 0
    bench.write(CCR, 0x202)
    bench["control"] = 1
    assert bench.write(STIR, 1)
    assert bench.write(ITM, ord("x"), 1)


def test_debug_registers_survive_a_system_reset():
    bench = Bench()
    bench.write(DEMCR, 0x0101_0000)
    bench.write(0xE000EDF8, 77)
    assert bench.read(DEMCR) == 0x0101_0000
    bench.write(CCR, 0)
    bench.reset(power_on=False)
    assert (bench.read(DEMCR) >> 24, bench.read(0xE000EDF8), bench.read(CCR)) == (1, 77, 0x200)
    bench.reset()
    assert (bench.read(DEMCR), bench.read(0xE000EDF8), bench.read(DFSR)) == (0, 0, 0)


def test_stimulus_ports_carry_bytes_when_they_are_on():
    code = Program()
    code.load(0, ITM_BASE + 4)
    code.movs(1, ord("A"))
    code.label("wait")
    code.ldr(2, 0)
    code.half(0x2A00)  # CMP r2, #0
    code.b("wait", 0)
    code.strb(1, 0)
    code.str(1, 0)
    code.forever()
    for unlocked in (False, True):
        bench = Bench(code.finish())
        if unlocked:
            bench.write(ITM + 0xFB0, 0xC5AC_CE55)
        bench.write(ITM + 0xE00, 2)
        bench.write(ITM + 0xE80, 1)
        bench.run(100)
        assert bench.text == ("<1:65/1><1:65/4>" if unlocked else "")


def test_comparators_are_registers_only():
    bench = Bench()
    for n in range(5):
        for offset, value in ((0, 0xFFFF_FFFF), (4, 31), (8, 0x000F_FFAF)):
            bench.write(DWT + 0x20 + 16 * n + offset, 0xFFFF_FFFF)
            assert bench.read(DWT + 0x20 + 16 * n + offset) == (value if n < 4 else 0)
    assert LOG
