"""Faults: the status bits they set, the reported address, the handler (B1.5.14)."""

from collections.abc import Callable

import pytest

from .bench import LOCKUP, LOG, PULSE, RAM, STOP, SYSTEM, Bench
from .thumb import Program

TOP = 0x2000_8000
NOWHERE = 0x3000_0000
ENABLE_ALL = 7 << 16

IACCVIOL, IBUSERR, PRECISERR, IMPRECISERR, UNSTKERR, STKERR, BFARVALID = (
    1 << n for n in (0, 8, 9, 10, 11, 12, 15)
)
UNDEFINSTR, INVSTATE, INVPC, NOCP, UNALIGNED, DIVBYZERO = (1 << n for n in (16, 17, 18, 19, 24, 25))
VECTTBL, FORCED, DEBUGEVT = 1 << 1, 1 << 30, 1 << 31
HARD_FAULT, MEM_MANAGE, BUS_FAULT, USAGE_FAULT = 3, 4, 5, 6

Write = Callable[[Program], int]


def with_handlers(code: Program) -> Program:
    """Add handlers of all system exceptions that loop forever."""
    for number in range(2, 16):
        code.handler(number)
        code.forever()
    return code


def prepare(code: Program, *, enabled: bool = True, interrupt_at: int | None = None) -> Bench:
    """A bench with fault handlers, and optionally interrupt 0 at a cycle."""
    bench = Bench(code.finish())
    bench["SHCSR"] = ENABLE_ALL * enabled
    if interrupt_at is not None:
        bench["ISER"] = 1
        bench.at(interrupt_at, PULSE, 0)
    return bench


def run(
    write: Write,
    cycles: int = 100,
    *,
    stack: int = TOP,
    enabled: bool = True,
    interrupt_at: int | None = None,
) -> Bench:
    """Run what ``write`` assembles, followed by fault handlers that loop."""
    code = Program(stack)
    write(code)
    bench = prepare(with_handlers(code), enabled=enabled, interrupt_at=interrupt_at)
    bench.run(cycles)
    return bench


def in_handler(*steps: Write) -> Write:
    """NOPs, and a handler of interrupt 0 made of ``steps``."""

    def write(code: Program) -> int:
        code.nop(50)
        code.handler(16)
        return [step(code) for step in steps][-1]

    return write


def halves(*values: int) -> Write:
    return lambda code: code.half(*values)


def jump(address: int) -> Write:
    def write(code: Program) -> int:
        code.load(0, address)
        return code.bx(0)

    return write


def load_from(address: int) -> Write:
    def write(code: Program) -> int:
        code.load(0, address)
        return code.ldr(1, 0)

    return write


def store_to(address: int, precise: bool = False) -> Write:
    def write(code: Program) -> int:
        if precise:
            code.poke(SYSTEM["ACTLR"], 2, by=(0, 1))
        code.load(0, address)
        return code.str(1, 0)

    return write


def with_trap(bit: int, *values: int) -> Write:
    """Set a bit of CCR, then execute ``values`` with r0 = 0x20000001 and r1 = 0."""

    def write(code: Program) -> int:
        code.poke(SYSTEM["CCR"], 0x200 | bit, by=(0, 1))
        code.load(0, RAM + 1)
        code.movs(1, 0)
        return code.half(*values)

    return write


PRECISE = PRECISERR | BFARVALID
CASES = {
    # name: (program, exception, CFSR, BFAR, stacked PC if not the instruction's)
    "undefined": (halves(0xDE00), USAGE_FAULT, UNDEFINSTR, None, None),
    "no ARM state": (jump(0x1000), USAGE_FAULT, INVSTATE, None, 0x1000),
    "coprocessor": (halves(0xEE00, 0x0A10), USAGE_FAULT, NOCP, None, None),
    "divide by zero": (with_trap(16, 0xFBB0, 0xF2F1), USAGE_FAULT, DIVBYZERO, None, None),
    "unaligned word": (with_trap(8, 0x6801), USAGE_FAULT, UNALIGNED, None, None),
    "unaligned pair": (with_trap(0, 0xE9D0, 0x1200), USAGE_FAULT, UNALIGNED, None, None),
    "jump into a peripheral": (jump(0x4000_0001), MEM_MANAGE, IACCVIOL, None, 0x4000_0000),
    "jump into the system": (jump(0xE000_E001), MEM_MANAGE, IACCVIOL, None, 0xE000_E000),
    "jump to no memory": (jump(NOWHERE | 1), BUS_FAULT, IBUSERR, None, NOWHERE),
    "load from no memory": (load_from(NOWHERE), BUS_FAULT, PRECISE, NOWHERE, None),
    "load from no peripheral": (load_from(0x4100_0004), BUS_FAULT, PRECISE, 0x4100_0004, None),
    "precise store": (store_to(NOWHERE, precise=True), BUS_FAULT, PRECISE, NOWHERE, None),
}


@pytest.mark.parametrize("enabled", [True, False])
@pytest.mark.parametrize("name", CASES)
def test_fault(name, enabled):
    write, exception, cfsr, address, at = CASES[name]
    code = Program()
    code.nop()
    where = write(code)
    bench = prepare(with_handlers(code), enabled=enabled)
    bench.run(200)
    assert bench.ipsr == (exception if enabled else HARD_FAULT)
    assert bench["CFSR"] == cfsr
    assert bench["HFSR"] == (0 if enabled else FORCED)
    assert bench.word(TOP - 32 + 24) == (where if at is None else at)
    if address is not None:
        assert bench["BFAR"] == address
    assert bench.fault[:3] == (bench.ipsr, cfsr, bench["HFSR"])
    assert bench.fault.frame == TOP - 32
    active = {4: 0, 5: 1, 6: 3}[exception]
    assert bench["SHCSR"] & 0xFFFF == (1 << active if enabled else 0)
    bench["CFSR"] = cfsr & 0xFFFF_FFFE
    assert bench["CFSR"] == cfsr & 1
    bench.write(SYSTEM["CFSR"], 0xFF, 1)
    assert bench["CFSR"] == 0


def test_without_traps_nothing_faults():
    code = Program()
    code.load(0, RAM + 1)
    code.movs(1, 0)
    code.ldr(2, 0)
    code.udiv(3, 0, 1)
    code.forever()
    bench = Bench(with_handlers(code).finish())
    bench["r3"] = 99
    bench.run(100)
    assert (bench.ipsr, bench["r3"]) == (0, 0)


@pytest.mark.parametrize("masked", [False, True])
def test_store_through_the_write_buffer_faults_later_and_waits_while_masked(masked):
    code = Program()
    if masked:
        code.cps(False)  # PRIMASK
    store = store_to(NOWHERE)(code)
    code.nop(5)
    code.cps(True)
    after = code.forever()
    bench = prepare(with_handlers(code))
    bench.run(100)
    assert (bench.ipsr, bench["CFSR"]) == (BUS_FAULT, IMPRECISERR)
    stacked = bench.word(TOP - 32 + 24)
    assert stacked == after if masked else store < stacked < after


@pytest.mark.parametrize("priority", [0x40, 0x80])
def test_fault_of_too_low_priority_escalates(priority):
    code = Program()
    code.half(0xDE00)
    bench = prepare(with_handlers(code))
    bench["SHPR1"] = priority << 16
    bench["basepri"] = 0x60
    bench.run(50)
    assert bench.ipsr == (USAGE_FAULT if priority < 0x60 else HARD_FAULT)


def test_fault_in_the_hard_fault_handler_locks_up():
    code = Program()
    code.half(0xDE00)
    code.handler(3)
    where = code.half(0xDE01)
    bench = Bench(code.finish())
    assert bench.run(100) & LOCKUP
    assert bench["locked"]
    assert (bench.fault.exception, bench.fault.pc, bench.fault.count) == (0, where, 2)
    assert bench.run(100) & LOCKUP  # until a reset
    bench.reset()
    assert not bench["locked"]


def test_nmi_ends_a_lock_up():
    code = Program()
    code.half(0xDE00)
    code.handler(3)
    code.half(0xDE01)
    code.handler(2)
    code.forever()
    bench = Bench(code.finish())
    bench.run(100)
    bench["ICSR"] = 1 << 31
    bench.run(50)
    assert (bench.ipsr, bench["locked"]) == (2, 0)


def test_unusable_vector_table_locks_up():
    code = Program()
    code.vector(1, 0xFFFF_FFFF)
    code.vector(3, 0xFFFF_FFFF)
    bench = Bench(code.finish())
    bench.run(1000)  # the start faults, then the handler
    assert bench["locked"]


def test_handler_runs_although_stacking_failed():
    bench = run(halves(0xDE00), 1000, stack=NOWHERE, enabled=False)
    assert (bench.ipsr, bench["CFSR"]) == (HARD_FAULT, UNDEFINSTR | STKERR)
    assert bench.fault.frame == 0


def test_stack_overflow_is_a_stacking_error():
    bench = run(Program.forever, stack=RAM + 16, interrupt_at=20)
    assert (bench.ipsr, bench["CFSR"]) == (BUS_FAULT, STKERR)
    assert bench["ISPR"] == 1  # the interrupt still waits, its number is higher


def test_more_urgent_exception_is_entered_despite_a_stacking_error():
    code = Program(stack=RAM + 16)
    code.forever()
    with_handlers(code).handler(16)
    code.load(0, LOG)
    code.str(0, 0)
    code.bx()
    bench = prepare(code, interrupt_at=20)
    bench["SHPR1"] = 0x80 << 8
    bench.run(100)
    assert (bench.log[0].exception, bench.ipsr) == (16, BUS_FAULT)
    assert bench["CFSR"] == STKERR


def test_unstacking_error():
    bench = run(
        in_handler(lambda code: code.load(0, NOWHERE), lambda code: code.msr("msp", 0), Program.bx),
        60,
        interrupt_at=5,
    )
    assert (bench["CFSR"] & ~STKERR, bench.ipsr) == (UNSTKERR, BUS_FAULT)
    assert bench["sp"] == NOWHERE
    assert bench["lr"] == 0xFFFF_FFF9  # of the return that failed


def test_unreadable_vector_is_a_hard_fault():
    code = Program()
    code.forever()
    bench = Bench(with_handlers(code).finish())
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
    bench = run(in_handler(jump(value)), interrupt_at=5)
    assert (bench.ipsr, bench["CFSR"], bench["lr"]) == (USAGE_FAULT, INVPC, value)
    assert bench["sp"] == TOP - 32  # tail-chained: no new frame


@pytest.mark.parametrize("allowed", [True, False])
def test_return_to_thread_from_a_nested_handler(allowed):
    code = with_handlers(Program())
    code.at = 0x400
    code.nop(80)
    code.handler(16, 0x600)
    code.nop(40)
    code.handler(17)
    code.half(0x9807)  # LDR r0, [sp, #28]
    code.half(0x0A40, 0x0240)  # LSRS, LSLS r0, #9: no exception number
    code.half(0x9007)  # STR r0, [sp, #28]
    jump(0xFFFF_FFF9)(code)
    bench = prepare(code, interrupt_at=5)
    bench["CCR"] = 0x200 | allowed
    bench.write(SYSTEM["IPR"], 0x4080, 2)
    bench["ISER"] = 3
    bench.at(25, PULSE, 1)
    bench.run(70)
    assert bench.ipsr == (0 if allowed else USAGE_FAULT)
    assert bench["CFSR"] == (0 if allowed else INVPC)
    assert bench["IABR"] == 1  # of the two, the first is still active


def test_frame_with_another_exception_number_is_a_usage_fault():
    load, store = halves(0x9807), halves(0x9007)  # LDR, STR r0, [sp, #28]
    bench = run(in_handler(load, lambda code: code.adds(0, 1), store, Program.bx), interrupt_at=5)
    assert (bench.ipsr, bench["CFSR"]) == (USAGE_FAULT, INVPC)


def test_return_of_an_inactive_exception_is_a_usage_fault():
    code = Program()
    code.nop(50)
    with_handlers(code).handler(15)
    code.poke(SYSTEM["SHCSR"], ENABLE_ALL, by=(0, 1))  # clears SysTick's active bit
    code.bx()
    bench = Bench(code.finish())
    bench["ICSR"] = 1 << 26
    bench.run(100)
    assert (bench.ipsr, bench["CFSR"]) == (USAGE_FAULT, INVPC)


def test_bfhfnmign_ignores_bus_faults_in_the_hard_fault_handler():
    code = Program()
    code.half(0xDE00)
    code.handler(3)
    code.load(0, NOWHERE)
    code.movs(1, 5)
    code.ldr(1, 0)
    code.forever()
    bench = Bench(code.finish())
    bench["CCR"] = 0x300
    bench.run(100)
    assert (bench.ipsr, bench["locked"]) == (HARD_FAULT, 0)
    assert bench["CFSR"] == UNDEFINSTR | PRECISE


@pytest.mark.parametrize(("monitor", "ipsr", "hfsr"), [(0, HARD_FAULT, DEBUGEVT), (1 << 16, 12, 0)])
def test_breakpoint_without_debugger(monitor, ipsr, hfsr):
    code = Program()
    where = code.bkpt(3)
    bench = Bench(with_handlers(code).finish())
    bench["DEMCR"] = monitor
    bench.run(50)
    assert (bench.ipsr, bench["HFSR"], bench["DFSR"]) == (ipsr, hfsr, 2)
    assert bench.word(TOP - 32 + 24) == where


def test_breakpoint_with_a_debugger_stops_before_it():
    code = Program()
    where = code.bkpt(3)
    bench = Bench(with_handlers(code).finish())
    bench.debugger(0)
    assert bench.run(50) & STOP
    assert (bench["pc"], bench.ipsr, bench["debug_stop"]) == (where, 0, 1)
    assert bench.peek(SYSTEM["DHCSR"]) & 1


def test_vector_catch_stops_at_the_beginning_of_the_handler():
    code = Program()
    code.half(0xDE00)
    bench = Bench(with_handlers(code).finish())
    bench.debugger(1 << 10)
    assert bench.run(50) & STOP
    assert (bench.ipsr, bench["debug_stop"]) == (HARD_FAULT, 2)
    assert bench["pc"] == int.from_bytes(bytes(bench.code[12:16]), "little") & ~1
    assert bench["MMFAR"] == 0
