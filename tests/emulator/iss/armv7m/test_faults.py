"""Faults: the status bits they set, the reported address, the handler (B1.5.14)."""

import pytest

from tests.together import together

from .bench import LOCKUP, LOG, PULSE, RAM, STOP, SYSTEM, Bench
from .thumb import Program, store

TOP = 0x2000_8000
NOWHERE = 0x3000_0000
ENABLE_ALL = 7 << 16

IACCVIOL, IBUSERR, PRECISERR, IMPRECISERR, UNSTKERR, STKERR, BFARVALID = (
    1 << n for n in (0, 8, 9, 10, 11, 12, 15)
)
UNDEFINSTR, INVSTATE, INVPC, NOCP, UNALIGNED, DIVBYZERO = (1 << n for n in (16, 17, 18, 19, 24, 25))
VECTTBL, FORCED, DEBUGEVT = 1 << 1, 1 << 30, 1 << 31
HARD_FAULT, MEM_MANAGE, BUS_FAULT, USAGE_FAULT = 3, 4, 5, 6

LOAD_XPSR, STORE_XPSR = "ldr r0, [sp, #28]", "str r0, [sp, #28]"  # of the frame
HANDLERS = "; ".join(f"@{number}: b ." for number in range(2, 16))
"""Handlers of all system exceptions that loop forever."""


def prepare(program: str | Program, *, enabled: bool = True, at: int | None = None) -> Bench:
    """A bench with fault handlers, and optionally interrupt 0 at a cycle."""
    bench = Bench(f"{program}; {HANDLERS}" if isinstance(program, str) else program)
    bench["SHCSR"] = ENABLE_ALL * enabled
    if at is not None:
        bench["ISER"] = 1
        bench.at(at, PULSE, 0)
    return bench


def run(
    program: str | Program, cycles: int = 100, *, enabled: bool = True, at: int | None = None
) -> Bench:
    bench = prepare(program, enabled=enabled, at=at)
    bench.run(cycles)
    return bench


def jump(address: int) -> str:
    return f"ldr r0, ={address}; here: bx r0"


def load_from(address: int) -> str:
    return f"ldr r0, ={address}; here: ldr r1, [r0]"


def store_to(address: int) -> str:
    return f"ldr r0, ={address}; here: str r1, [r0]"


def with_trap(bit: int, instruction: str) -> str:
    """Set a bit of CCR, then execute an instruction with r0 = 0x20000001 and r1 = 0."""
    return f"{store(SYSTEM['CCR'], 0x200 | bit)}; ldr r0, ={RAM + 1}; movs r1, #0; {instruction}"


LDRD = ".short 0xE9D0, 0x1200"  # r1, r2, [r0]
UNBUFFERED = store(SYSTEM["ACTLR"], 2)  # stores without the write buffer
PRECISE = PRECISERR | BFARVALID
CASES = {
    # name: (program, exception, CFSR, BFAR, stacked PC if not the instruction's)
    "undefined": ("here: udf #0", USAGE_FAULT, UNDEFINSTR, None, None),
    "no ARM state": (jump(0x1000), USAGE_FAULT, INVSTATE, None, 0x1000),
    "coprocessor": ("here: .short 0xEE00, 0x0A10", USAGE_FAULT, NOCP, None, None),
    "divide by zero": (with_trap(16, "here: udiv r2, r0, r1"), USAGE_FAULT, DIVBYZERO, None, None),
    "unaligned word": (with_trap(8, "here: ldr r1, [r0]"), USAGE_FAULT, UNALIGNED, None, None),
    "unaligned pair": (with_trap(0, f"here: {LDRD}"), USAGE_FAULT, UNALIGNED, None, None),
    "jump into a peripheral": (jump(0x4000_0001), MEM_MANAGE, IACCVIOL, None, 0x4000_0000),
    "jump into the system": (jump(0xE000_E001), MEM_MANAGE, IACCVIOL, None, 0xE000_E000),
    "jump to no memory": (jump(NOWHERE | 1), BUS_FAULT, IBUSERR, None, NOWHERE),
    "load from no memory": (load_from(NOWHERE), BUS_FAULT, PRECISE, NOWHERE, None),
    "load from no peripheral": (load_from(0x4100_0004), BUS_FAULT, PRECISE, 0x4100_0004, None),
    "precise store": (f"{UNBUFFERED}; {store_to(NOWHERE)}", BUS_FAULT, PRECISE, NOWHERE, None),
}


@together("enabled", [True, False])
@together("name", CASES)
def test_faults_enter_their_handler_with_status_and_address(name, enabled):
    program, exception, cfsr, address, at = CASES[name]
    bench = run(f"nop; {program}", 200, enabled=enabled)
    assert bench.ipsr == (exception if enabled else HARD_FAULT)
    assert bench["CFSR"] == cfsr
    assert bench["HFSR"] == (0 if enabled else FORCED)
    assert bench.word(TOP - 32 + 24) == (bench.labels["here"] if at is None else at)
    if address is not None:
        assert bench["BFAR"] == address
    fault = bench.fault
    assert (fault.exception, fault.cfsr, fault.hfsr) == (bench.ipsr, cfsr, bench["HFSR"])
    assert fault.frame == TOP - 32
    active = {4: 0, 5: 1, 6: 3}[exception]
    assert bench["SHCSR"] & 0xFFFF == (1 << active if enabled else 0)
    bench["CFSR"] = cfsr & 0xFFFF_FFFE
    assert bench["CFSR"] == cfsr & 1
    bench.write(SYSTEM["CFSR"], 0xFF, 1)
    assert bench["CFSR"] == 0


def test_unaligned_access_and_division_by_zero_do_not_fault_without_traps():
    unaligned, division = "ldr r2, [r0]", "udiv r3, r0, r1"
    bench = prepare(f"ldr r0, ={RAM + 1}; movs r1, #0; {unaligned}; {division}; b .")
    bench["r3"] = 99
    bench.run(100)
    assert (bench.ipsr, bench["r3"]) == (0, 0)


@pytest.mark.parametrize("masked", [False, True])
def test_store_through_the_write_buffer_faults_later_and_waits_while_masked(masked):
    begin = "cpsid i; " * masked
    bench = run(f"{begin}{store_to(NOWHERE)}; nop #5; cpsie i; after: b .")
    assert (bench.ipsr, bench["CFSR"]) == (BUS_FAULT, IMPRECISERR)
    stacked = bench.word(TOP - 32 + 24)
    here, after = bench.labels["here"], bench.labels["after"]
    assert stacked == after if masked else here < stacked < after


@pytest.mark.parametrize("priority", [0x40, 0x80])
def test_fault_of_too_low_priority_escalates(priority):
    bench = prepare("udf #0")
    bench["SHPR1"] = priority << 16
    bench["basepri"] = 0x60
    bench.run(50)
    assert bench.ipsr == (USAGE_FAULT if priority < 0x60 else HARD_FAULT)


def test_fault_in_the_hard_fault_handler_locks_up():
    bench = Bench("udf #0; @3: here: udf #1")
    assert bench.run(100) & LOCKUP
    assert bench["locked"]
    assert (bench.fault.exception, bench.fault.pc, bench.fault.count) == (
        0,
        bench.labels["here"],
        2,
    )
    assert bench.run(100) & LOCKUP  # until a reset
    bench.reset()
    assert not bench["locked"]


def test_nmi_ends_a_lock_up():
    bench = Bench("udf #0; @3: udf #1; @2: b .")
    bench.run(100)
    bench["ICSR"] = 1 << 31
    bench.run(50)
    assert (bench.ipsr, bench["locked"]) == (2, 0)


def test_unusable_vector_table_locks_up():
    bench = Bench(".org 4; .short 0xFFFF, 0xFFFF; .org 12; .short 0xFFFF, 0xFFFF")
    bench.run(1000)  # the start faults, then the handler
    assert bench["locked"]


def test_handler_runs_although_stacking_failed():
    bench = run(Program(f"udf #0; {HANDLERS}", stack=NOWHERE), 1000, enabled=False)
    assert (bench.ipsr, bench["CFSR"]) == (HARD_FAULT, UNDEFINSTR | STKERR)
    assert bench.fault.frame == 0


def test_stack_overflow_is_a_stacking_error():
    bench = run(Program(f"b .; {HANDLERS}", stack=RAM + 16), at=20)
    assert (bench.ipsr, bench["CFSR"]) == (BUS_FAULT, STKERR)
    assert bench["ISPR"] == 1  # the interrupt still waits, its number is higher


def test_more_urgent_exception_is_entered_despite_a_stacking_error():
    logs = f"@16: ldr r0, ={LOG}; str r0, [r0]; bx lr"
    bench = prepare(Program(f"b .; {HANDLERS}; {logs}", stack=RAM + 16), at=20)
    bench["SHPR1"] = 0x80 << 8
    bench.run(100)
    assert (bench.log[0].exception, bench.ipsr) == (16, BUS_FAULT)
    assert bench["CFSR"] == STKERR


def test_unstacking_error_is_a_bus_fault():
    bench = run(f"nop #50; @16: ldr r0, ={NOWHERE}; msr msp, r0; bx lr", 60, at=5)
    assert (bench["CFSR"] & ~STKERR, bench.ipsr) == (UNSTKERR, BUS_FAULT)
    assert bench["sp"] == NOWHERE
    assert bench["lr"] == 0xFFFF_FFF9  # of the return that failed


def test_unreadable_vector_is_a_hard_fault():
    bench = Bench(f"b .; {HANDLERS}")
    bench.ram[0xFF80:] = bench.code[:0x80]  # the memory ends after exception 31
    bench["VTOR"] = RAM + 0xFF80
    bench["ISER"] = 1 << 16
    bench.at(bench.cycles + 5, PULSE, 16)
    bench.run(60)
    assert (bench["HFSR"], bench.ipsr) == (VECTTBL, HARD_FAULT)


@pytest.mark.parametrize(
    "value",
    [
        0xFFFF_FFF5,  # reserved
        0xF000_0009,  # upper bits
        0xFFFF_FFF1,  # to a handler, although none is active
    ],
    ids=hex,
)
def test_wrong_return_value_is_a_usage_fault(value):
    bench = run(f"nop #50; @16: {jump(value)}", at=5)
    assert (bench.ipsr, bench["CFSR"], bench["lr"]) == (USAGE_FAULT, INVPC, value)
    assert bench["sp"] == TOP - 32  # tail-chained: no new frame


@pytest.mark.parametrize("allowed", [True, False])
def test_return_to_thread_from_a_nested_handler(allowed):
    outer = "nop #80; .org 0x600; @16: nop #40"
    # LSRS, LSLS r0, #9: no exception number
    inner = f"@17: {LOAD_XPSR}; .short 0x0A40, 0x0240; {STORE_XPSR}; {jump(0xFFFF_FFF9)}"
    bench = prepare(f"{outer}; {inner}", at=5)
    bench["CCR"] = 0x200 | allowed
    bench.write(SYSTEM["IPR"], 0x4080, 2)
    bench["ISER"] = 3
    bench.at(25, PULSE, 1)
    bench.run(70)
    assert bench.ipsr == (0 if allowed else USAGE_FAULT)
    assert bench["CFSR"] == (0 if allowed else INVPC)
    assert bench["IABR"] == 1  # of the two, the first is still active


def test_frame_with_another_exception_number_is_a_usage_fault():
    bench = run(f"nop #50; @16: {LOAD_XPSR}; adds r0, #1; {STORE_XPSR}; bx lr", at=5)
    assert (bench.ipsr, bench["CFSR"]) == (USAGE_FAULT, INVPC)


def test_return_of_an_inactive_exception_is_a_usage_fault():
    clear = store(SYSTEM["SHCSR"], ENABLE_ALL)  # SysTick's active bit
    bench = Bench(f"nop #50; {HANDLERS}; @15: {clear}; bx lr")
    bench["ICSR"] = 1 << 26
    bench.run(100)
    assert (bench.ipsr, bench["CFSR"]) == (USAGE_FAULT, INVPC)


def test_bfhfnmign_ignores_bus_faults_in_the_hard_fault_handler():
    bench = Bench(f"udf #0; @3: ldr r0, ={NOWHERE}; movs r1, #5; ldr r1, [r0]; movs r2, #7; b .")
    bench["CCR"] = 0x300
    bench.run(100)
    assert (bench.ipsr, bench["locked"]) == (HARD_FAULT, 0)
    assert bench["CFSR"] == UNDEFINSTR | PRECISE
    assert (bench["r2"], bench["BFAR"]) == (7, NOWHERE)  # the load did not stop the handler


@pytest.mark.parametrize(
    "load",
    [
        pytest.param("ldr r1, [r0]", id="LDR"),
        pytest.param(".short 0xE9D0, 0x1300", id="LDRD r1, r3"),
        pytest.param(".short 0xC80A", id="LDM r0!, {r1, r3}"),
        pytest.param(".short 0xE850, 0x1F00", id="LDREX r1"),
        pytest.param(".short 0xF850, 0x1E00", id="LDRT r1"),
    ],
)
def test_bfhfnmign_ignores_bus_faults_of_every_load_with_faultmask(load):
    bench = run(f"cpsid f; ldr r0, ={NOWHERE}; {load}; movs r2, #7; b .", cycles=0)
    bench["CCR"] = 0x300
    bench.run(100)
    assert (bench.ipsr, bench["locked"], bench["r2"]) == (0, 0, 7)
    assert bench["CFSR"] == PRECISE


@pytest.mark.parametrize(("monitor", "ipsr", "hfsr"), [(0, HARD_FAULT, DEBUGEVT), (1 << 16, 12, 0)])
def test_breakpoint_without_debugger(monitor, ipsr, hfsr):
    bench = Bench(f"here: bkpt #3; {HANDLERS}")
    bench["DEMCR"] = monitor
    bench.run(50)
    assert (bench.ipsr, bench["HFSR"], bench["DFSR"]) == (ipsr, hfsr, 2)
    assert bench.word(TOP - 32 + 24) == bench.labels["here"]


def test_breakpoint_with_a_debugger_stops_before_it():
    bench = Bench(f"here: bkpt #3; {HANDLERS}")
    bench.debugger(0)
    assert bench.run(50) & STOP
    assert (bench["pc"], bench.ipsr, bench["debug_stop"]) == (bench.labels["here"], 0, 1)
    assert bench.peek(SYSTEM["DHCSR"]) & 1


def test_vector_catch_stops_at_the_beginning_of_the_handler():
    bench = Bench(f"udf #0; {HANDLERS}")
    bench.debugger(1 << 10)
    assert bench.run(50) & STOP
    assert (bench.ipsr, bench["debug_stop"]) == (HARD_FAULT, 2)
    assert bench["pc"] == int.from_bytes(bytes(bench.code[12:16]), "little") & ~1
    assert bench["MMFAR"] == 0
