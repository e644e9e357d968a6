"""Registers of the system control space: reset values, writable bits, sizes of access (B3.2)."""

from tests.together import together

from .bench import SYSTEM, Bench

AFTER_RESET_AND_ONES = {
    # address: (value after reset, value after ones were written)
    0xE000E004: (1, 1),  # ICTR
    SYSTEM["ACTLR"]: (0, 7),
    0xE000ED00: (0x412F_C231, 0x412F_C231),  # CPUID
    SYSTEM["VTOR"]: (0, 0x3FFF_FF80),
    SYSTEM["AIRCR"]: (0xFA05_0000, 0xFA05_0000),
    SYSTEM["SCR"]: (0, 0x16),
    SYSTEM["CCR"]: (0x200, 0x31B),
    SYSTEM["SHPR1"]: (0, 0x00E0_E0E0),
    SYSTEM["SHPR2"]: (0, 0xE000_0000),
    SYSTEM["SHPR3"]: (0, 0xE0E0_00E0),
    0xE000ED30: (0, 0),
    0xE000ED40: (0x30, 0x30),  # ID_PFR0
    0xE000ED70: (0x0131_0132, 0x0131_0132),  # ID_ISAR4
    0xE000ED88: (0, 0),  # CPACR: no floating point
    0xE000ED90: (0x800, 0x800),  # MPU_TYPE
    0xE0002000: (0x260, 0x261),  # FP_CTRL: 6 and 2 comparators
    SYSTEM["DWT"]: (0x4000_0000, 0x407F_1FFF),
}


@together("address", AFTER_RESET_AND_ONES)
def test_scs_registers_have_reset_values_and_writable_bits(address):
    bench = Bench()
    reset, ones = AFTER_RESET_AND_ONES[address]
    assert bench.read(address) == bench.peek(address) == reset
    assert bench.write(address, 0xFFFF_FFFF)
    assert bench.read(address) == ones
    bench.reset()
    assert bench.read(address) == reset


def test_addresses_without_registers_are_bus_errors():
    bench = Bench()
    for address in (0xE000_3000, 0xE000_D000, 0xE001_0000, 0xE00A_0000):
        assert bench.read(address) is None
        assert not bench.write(address, 0)
    assert bench.read(0xE004_0000) == 0  # TPIU: not modelled, reported


def test_only_priorities_and_fault_status_can_be_written_in_bytes():
    bench = Bench()
    bench.write(SYSTEM["SHPR3"] + 2, 0xFF, 1)
    assert bench["SHPR3"] == 0x00E0_0000
    assert bench.read(SYSTEM["SHPR3"] + 2, 1) == 0xE0
    assert bench.read(SYSTEM["SHPR3"] + 2, 2) == 0x00E0
    bench.write(SYSTEM["SCR"], 0x16, 1)  # others: words only
    assert bench["SCR"] == 0
    assert bench.read(SYSTEM["CFSR"] + 1, 1) == 0


def test_shcsr_icsr_and_stir_set_pending_exceptions():
    bench = Bench()
    bench["primask"] = 1
    bench["SHCSR"] = 1 << 15 | 7 << 16
    assert bench["SHCSR"] == 1 << 15 | 7 << 16
    assert bench["ICSR"] >> 12 & 0x1FF == 11
    bench["ICSR"] = 1 << 28
    assert bench["ICSR"] >> 28 & 1
    bench["ICSR"] = 1 << 27
    assert not bench["ICSR"] >> 28 & 1
    bench["STIR"] = 38
    assert bench["ICSR"] >> 22 & 1
    bench["STIR"] = 39
    assert bench.read(SYSTEM["ISPR"] + 4) == 0x40


def test_unprivileged_access_is_a_bus_error_except_stir_and_stimulus_ports():
    bench = Bench()
    bench["control"] = 1
    assert bench.read(SYSTEM["ICSR"]) is None
    assert not bench.write(SYSTEM["SCR"], 2)
    assert not bench.write(SYSTEM["STIR"], 1)
    bench["control"] = 0
    bench["CCR"] = 0x202
    bench["control"] = 1
    bench["STIR"] = 1
    assert bench.write(SYSTEM["ITM"], ord("x"), 1)


def test_debug_registers_survive_a_system_reset():
    bench = Bench()
    bench["DEMCR"] = 0x0101_0000
    bench["DCRDR"] = 77
    assert bench["DEMCR"] == 0x0101_0000
    bench["CCR"] = 0
    bench.reset(power_on=False)
    assert (bench["DEMCR"] >> 24, bench["DCRDR"], bench["CCR"]) == (1, 77, 0x200)
    bench.reset()
    assert (bench["DEMCR"], bench["DCRDR"], bench["DFSR"]) == (0, 0, 0)


def test_enabled_stimulus_ports_forward_data():
    port = f"ldr r0, ={SYSTEM['ITM'] + 4}; movs r1, #{ord('A')}"
    wait = "wait: ldr r2, [r0]; cmp r2, #0; beq wait"
    for unlocked in (False, True):
        bench = Bench(f"{port}; {wait}; strb r1, [r0]; str r1, [r0]; b .")
        if unlocked:
            bench.write(SYSTEM["ITM"] + 0xFB0, 0xC5AC_CE55)
        bench.write(SYSTEM["ITM"] + 0xE00, 2)
        bench.write(SYSTEM["ITM"] + 0xE80, 1)
        bench.run(100)
        assert bench.text == ("<1:65/1><1:65/4>" if unlocked else "")


def test_comparators_keep_their_writable_bits():
    bench = Bench()
    for n in range(5):
        for offset, value in ((0, 0xFFFF_FFFF), (4, 31), (8, 0x000F_FFAF)):
            bench.write(SYSTEM["DWT"] + 0x20 + 16 * n + offset, 0xFFFF_FFFF)
            assert bench.read(SYSTEM["DWT"] + 0x20 + 16 * n + offset) == (value if n < 4 else 0)
