"""Memory protection unit: matching region, access permissions, status of violations."""

import pytest

from tests.together import together

from .bench import PULSE, SYSTEM, Bench

TYPE, CTRL, RNR, RBAR, RASR = (SYSTEM["MPU"] + 4 * n for n in range(5))
ENABLE, HFNMIENA, PRIVDEFENA = 1, 2, 4
NONE, PRIVILEGED, USER_READS, FULL, _, READ_PRIVILEGED, READ_ONLY, READ_ONLY_TOO = range(8)
XN = 1 << 28
DACCVIOL_VALID, IACCVIOL, MSTKERR, MUNSTKERR = 0x82, 1, 16, 8

USER = 0x2000_2000
"""Address of the access under test."""


def attributes(size_log2: int, access: int, disabled_parts: int = 0, never: bool = False) -> int:
    """Value of RASR."""
    return never * XN | access << 24 | disabled_parts << 8 | (size_log2 - 1) << 1 | 1


def region(bench: Bench, number: int, base: int, value: int) -> None:
    bench.write(RBAR, base | 0x10 | number)
    bench.write(RASR, value)


def accessing(address: int, store: bool, privileged: bool) -> str:
    """A program that makes one access, then sets r2 to 1."""
    level = "" if privileged else "movs r0, #1; msr control, r0"
    access = "str r0, [r1]" if store else "ldr r0, [r1]"
    return f"ldr r1, ={address}; {level}; {access}; movs r2, #1; b .; @4: b ."


def guarded(program: str, control: int = ENABLE) -> Bench:
    """A bench with region 0 for the code and region 1 for the stack, both for all."""
    bench = Bench(program)
    region(bench, 0, 0, attributes(16, READ_ONLY))
    region(bench, 1, 0x2000_4000, attributes(14, FULL))
    bench.write(CTRL, control)
    bench["SHCSR"] = 1 << 16
    return bench


ALLOWED = {  # by AP: (privileged reads, writes, user reads, writes)
    NONE: (0, 0, 0, 0),
    PRIVILEGED: (1, 1, 0, 0),
    USER_READS: (1, 1, 1, 0),
    FULL: (1, 1, 1, 1),
    READ_PRIVILEGED: (1, 0, 0, 0),
    READ_ONLY: (1, 0, 1, 0),
    READ_ONLY_TOO: (1, 0, 1, 0),
}


@together("access", ALLOWED)
@together("case", range(4))
def test_mpu_enforces_region_access_permissions(access, case):
    bench = guarded(accessing(USER, store=bool(case & 1), privileged=case < 2))
    region(bench, 2, USER, attributes(5, access))
    bench.run(100)
    allowed = bool(ALLOWED[access][case])
    assert (bench["r2"], bench.ipsr) == ((1, 0) if allowed else (0, 4))
    if not allowed:
        assert (bench["CFSR"], bench["MMFAR"]) == (DACCVIOL_VALID, USER)


@pytest.mark.parametrize(
    ("control", "privileged", "allowed"),
    [
        (ENABLE, True, False),
        (ENABLE | PRIVDEFENA, True, True),
        (ENABLE | PRIVDEFENA, False, False),
        (0, False, True),
    ],
)
def test_mpu_background_region_is_for_privileged_access(control, privileged, allowed):
    bench = guarded(accessing(USER, False, privileged), control)
    bench.run(100)
    assert (bench.ipsr == 0) == allowed


@pytest.mark.parametrize(
    ("offset", "disabled_parts", "fault"), [(0, 0, True), (0, 1, False), (32, 1, True)]
)
def test_highest_numbered_region_decides_except_in_its_disabled_parts(
    offset, disabled_parts, fault
):
    bench = guarded(accessing(USER + offset, False, True))
    region(bench, 2, USER, attributes(13, FULL))
    region(bench, 3, USER, attributes(8, NONE, disabled_parts))  # 8 parts of 32 bytes
    bench.run(100)
    assert bench.ipsr == (4 if fault else 0)


JUMP = f"ldr r0, ={USER | 1}; bx r0; @4: b ."


def test_mpu_execute_never_faults_instruction_fetch():
    for never in (False, True):
        bench = guarded(JUMP)
        bench.ram[0x2000:0x2002] = [0xFE, 0xE7]
        region(bench, 2, USER, attributes(5, FULL, never=never))
        bench.run(100)
        assert bench.ipsr == (4 if never else 0)
        assert bench["CFSR"] == (IACCVIOL if never else 0)


def test_fetch_past_the_end_of_its_mpu_region_faults():
    bench = guarded(JUMP)
    bench.ram[0x2000:0x2100] = [0x00, 0xBF] * 128
    region(bench, 2, USER, attributes(5, FULL))
    bench.run(200)
    assert (bench.ipsr, bench["CFSR"]) == (4, IACCVIOL)
    assert bench.word(0x2000_8000 - 32 + 24) == USER + 32


def test_exception_stacking_uses_the_rights_of_the_interrupted_code():
    bench = guarded("nop #60; @4: b .")
    bench["psp"] = 0x2000_3000
    bench["control"] = 3
    bench["control"] = 2
    bench["ISER"] = 1
    bench["control"] = 3
    bench.at(5, PULSE, 0)
    bench.run(60)
    assert bench.ipsr == 4
    bench["control"] = 0
    assert (bench["CFSR"], bench["psp"]) == (MSTKERR, 0x2000_3000 - 32)


def test_mpu_checks_exception_unstacking():
    outside = f"ldr r0, ={USER}; msr psp, r0"  # all regions
    bench = guarded(f"nop #60; @16: {outside}; bx lr; @4: b .")
    bench["psp"] = 0x2000_7000
    bench["control"] = 2
    bench["ISER"] = 1
    bench.at(5, PULSE, 0)
    bench.run(80)
    assert (bench.ipsr, bench["CFSR"]) == (4, MUNSTKERR)
    assert bench["psp"] == USER


@pytest.mark.parametrize("on", [False, True])
def test_hfnmiena_enables_the_mpu_in_the_hard_fault_handler(on):
    program = f"udf #0; @3: ldr r1, ={USER}; ldr r0, [r1]; b ."
    bench = guarded(program, ENABLE | HFNMIENA * on)
    bench.run(100)
    assert bench["locked"] == on


def test_mpu_registers_read_and_write():
    bench = Bench()
    assert bench.read(TYPE) == 8 << 8
    bench.write(RNR, 5)
    bench.write(RNR, 8)  # not implemented
    assert bench.read(RNR) == 5
    bench.write(RBAR, 0x2000_0010 | 3)
    assert (bench.read(RNR), bench.read(RBAR)) == (3, 0x2000_0003)
    bench.write(RASR + 8, 0xFFFF_FFFF)  # an alias
    assert (bench.read(RASR), bench.read(RBAR + 8)) == (0x173F_FF3F, 0x2000_0003)
    bench.reset()
    assert (bench.read(CTRL), bench.read(RASR)) == (0, 0)
    assert bench["ICSR"] == 1 << 11
