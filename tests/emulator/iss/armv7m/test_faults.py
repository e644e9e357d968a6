"""Every way to a fault: the bits it sets, where it is laid to, who handles it (B1.5.14)."""

import pytest

from .bench import (
    ACTLR,
    BFAR,
    CCR,
    CFSR,
    DEMCR,
    DFSR,
    HFSR,
    ICSR,
    ISER,
    LOCKUP,
    LOG,
    MMFAR,
    PULSE,
    RAM,
    SHCSR,
    SHPR1,
    STOP,
    Bench,
)  # fmt: skip
from .thumb import Program

TOP = 0x2000_8000
NOWHERE = 0x3000_0000
ENABLE_ALL = 7 << 16

IACCVIOL, DACCVIOL, MUNSTKERR, MSTKERR, MMARVALID = 1, 2, 8, 16, 128
IBUSERR, PRECISERR, IMPRECISERR, UNSTKERR, STKERR, BFARVALID = (
    1 << 8, 1 << 9, 1 << 10, 1 << 11, 1 << 12, 1 << 15,
)  # fmt: skip
UNDEFINSTR, INVSTATE, INVPC, NOCP, UNALIGNED, DIVBYZERO = (
    1 << 16, 1 << 17, 1 << 18, 1 << 19, 1 << 24, 1 << 25,
)  # fmt: skip
VECTTBL, FORCED, DEBUGEVT = 1 << 1, 1 << 30, 1 << 31
MEM_MANAGE, BUS_FAULT, USAGE_FAULT = 4, 5, 6


def with_handlers(code: Program) -> Program:
    """Each fault's handler waits where it is."""
    for number in range(2, 16):
        code.handler(number)
        code.forever()
    return code


def jump(address: int):
    """A branch to an address."""

    def write(code: Program) -> int:
        code.load(0, address)
        return code.bx(0)

    return write


def load_from(address: int):
    """A load."""

    def write(code: Program) -> int:
        code.load(0, address)
        return code.ldr(1, 0)

    return write


def store_to(address: int, precise: bool = False):
    """A store."""

    def write(code: Program) -> int:
        if precise:
            code.poke(ACTLR, 2, by=(0, 1))
        code.load(0, address)
        return code.str(1, 0)

    return write


def with_trap(bit: int, *halves: int):
    """Set a bit of CCR, then this instruction on r0 = 0x20000001 and r1 = 0."""

    def write(code: Program) -> int:
        code.poke(CCR, 0x200 | bit, by=(0, 1))
        code.load(0, RAM + 1)
        code.movs(1, 0)
        return code.half(*halves)

    return write


def halves(*values: int):
    """An instruction."""
    return lambda code: code.half(*values)


CASES = {
    # name: (program, exception, CFSR, HFSR if not enabled, address, where the frame's PC points)
    "undefined": (halves(0xDE00), USAGE_FAULT, UNDEFINSTR, None, None),
    "no ARM state": (jump(0x1000), USAGE_FAULT, INVSTATE, None, 0x1000),
    "coprocessor": (halves(0xEE00, 0x0A10), USAGE_FAULT, NOCP, None, None),
    "divide by zero": (with_trap(16, 0xFBB0, 0xF2F1), USAGE_FAULT, DIVBYZERO, None, None),
    "unaligned word": (with_trap(8, 0x6801), USAGE_FAULT, UNALIGNED, None, None),
    "unaligned pair": (with_trap(0, 0xE9D0, 0x1200), USAGE_FAULT, UNALIGNED, None, None),
    "jump into a peripheral": (jump(0x4000_0001), MEM_MANAGE, IACCVIOL, None, 0x4000_0000),
    "jump into the system": (jump(0xE000_E001), MEM_MANAGE, IACCVIOL, None, 0xE000_E000),
    "jump into nowhere": (jump(NOWHERE | 1), BUS_FAULT, IBUSERR, None, NOWHERE),
    "load from nowhere": (
        load_from(NOWHERE), BUS_FAULT, PRECISERR | BFARVALID, NOWHERE, None,
    ),
    "load from a null peripheral": (
        load_from(0x4100_0004), BUS_FAULT, PRECISERR | BFARVALID, 0x4100_0004, None,
    ),
    "precise store": (
        store_to(NOWHERE, precise=True), BUS_FAULT, PRECISERR | BFARVALID, NOWHERE, None,
    ),
}  # fmt: skip


@pytest.mark.parametrize("enabled", [True, False])
@pytest.mark.parametrize("name", CASES)
def test_fault(name, enabled):
    write, exception, cfsr, address, at = CASES[name]
    code = Program()
    code.nop()
    where = write(code)
    bench = Bench(with_handlers(code).finish())
    bench.write(SHCSR, ENABLE_ALL * enabled)
    bench.run(200)
    assert bench.ipsr == (exception if enabled else 3)
    assert bench.read(CFSR) == cfsr
    assert bench.read(HFSR) == (0 if enabled else FORCED)
    assert bench.word(TOP - 32 + 24) == (where if at is None else at)
    if address is not None:
        assert bench.read(BFAR) == address
    assert bench.fault[:3] == (bench.ipsr, cfsr, bench.read(HFSR))
    assert bench.fault.frame == TOP - 32
    active = {4: 0, 5: 1, 6: 3}[exception]
    assert bench.read(SHCSR) & 0xFFFF == (1 << active if enabled else 0)
    bench.write(CFSR, cfsr & 0xFFFF_FFFE)
    assert bench.read(CFSR) == cfsr & 1
    bench.write(CFSR, 0xFF, 1)
    assert bench.read(CFSR) == 0


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


def test_a_store_through_the_write_buffer_faults_later():
    code = Program()
    store = store_to(NOWHERE)(code)
    code.nop(5)
    code.forever()
    bench = Bench(with_handlers(code).finish())
    bench.write(SHCSR, ENABLE_ALL)
    bench.run(100)
    assert bench.ipsr == BUS_FAULT
    assert bench.read(CFSR) == IMPRECISERR
    assert bench.word(TOP - 32 + 24) > store


def test_imprecise_fault_waits_while_it_is_masked():
    code = Program()
    code.cps(False)  # PRIMASK
    store_to(NOWHERE)(code)
    code.nop(5)
    code.cps(True)
    after = code.forever()
    bench = Bench(with_handlers(code).finish())
    bench.write(SHCSR, ENABLE_ALL)
    bench.run(100)
    assert bench.ipsr == BUS_FAULT
    assert bench.word(TOP - 32 + 24) == after


@pytest.mark.parametrize("priority", [0x40, 0x80])
def test_a_fault_of_too_low_priority_is_forced(priority):
    code = Program()
    code.half(0xDE00)
    bench = Bench(with_handlers(code).finish())
    bench.write(SHCSR, ENABLE_ALL)
    bench.write(SHPR1, priority << 16)
    bench["basepri"] = 0x60
    bench.run(50)
    assert bench.ipsr == (USAGE_FAULT if priority < 0x60 else 3)


def test_a_fault_in_the_hard_fault_handler_locks_up():
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


def test_an_nmi_leaves_the_lock_up():
    code = Program()
    code.half(0xDE00)
    code.handler(3)
    code.half(0xDE01)
    code.handler(2)
    code.forever()
    bench = Bench(code.finish())
    bench.run(100)
    bench.write(ICSR, 1 << 31)
    bench.run(50)
    assert (bench.ipsr, bench["locked"]) == (2, 0)


@pytest.mark.parametrize("where", ["vectors", "stack"])
def test_reset_without_a_usable_vector_table(where):
    code = Program(stack=NOWHERE if where == "stack" else TOP)
    if where == "vectors":
        code.vector(1, 0xFFFF_FFFF)
        code.vector(3, 0xFFFF_FFFF)
    else:
        code.half(0xDE00)
        with_handlers(code)
    bench = Bench(code.finish())
    bench.run(1000)
    if where == "vectors":  # the start faults, then the handler
        assert bench["locked"]
    else:  # the handler runs although nothing could be stacked
        assert bench.ipsr == 3
        assert bench.read(CFSR) == UNDEFINSTR | STKERR
        assert bench.fault.frame == 0


def test_stack_overflow_is_a_stacking_error():
    code = Program(stack=RAM + 16)
    code.forever()
    bench = Bench(with_handlers(code).finish())
    bench.write(SHCSR, ENABLE_ALL)
    bench.write(ISER, 1)
    bench.at(20, PULSE, 0)
    bench.run(100)
    assert bench.ipsr == BUS_FAULT
    assert bench.read(CFSR) == STKERR
    assert bench.read(ISER + 0x100) == 1  # the interrupt still waits, less urgent by number


def test_a_more_urgent_exception_is_entered_in_spite_of_a_stacking_error():
    code = Program(stack=RAM + 16)
    code.forever()
    with_handlers(code).handler(16)
    code.load(0, LOG)
    code.str(0, 0)
    code.bx()
    bench = Bench(code.finish())
    bench.write(SHCSR, ENABLE_ALL)
    bench.write(SHPR1, 0x80 << 8)
    bench.write(ISER, 1)
    bench.at(20, PULSE, 0)
    bench.run(100)
    assert bench.log[0].exception == 16
    assert bench.ipsr == BUS_FAULT
    assert bench.read(CFSR) == STKERR


def test_unstacking_error():
    code = Program()
    code.nop(50)
    code.handler(16)
    code.load(0, NOWHERE)
    code.msr("msp", 0)
    code.bx()
    bench = Bench(with_handlers(code).finish())
    bench.write(SHCSR, ENABLE_ALL)
    bench.write(ISER, 1)
    bench.at(5, PULSE, 0)
    bench.run(60)
    assert bench.read(CFSR) & ~STKERR == UNSTKERR
    assert bench.ipsr == BUS_FAULT
    assert bench["sp"] == NOWHERE
    assert bench["lr"] == 0xFFFF_FFF9  # as of the return that failed


def test_a_vector_that_can_not_be_read_is_a_hard_fault():
    code = Program()
    code.forever()
    bench = Bench(with_handlers(code).finish())
    table = RAM + 0xFF80  # the memory ends behind exception 31
    bench.ram[0xFF80:] = bench.code[:0x80]
    bench.write(0xE000ED08, table)
    bench.write(ISER, 1 << 16)
    bench.at(bench.cycles + 5, PULSE, 16)
    bench.run(60)
    assert bench.read(HFSR) == VECTTBL
    assert bench.ipsr == 3


RETURNS = {
    "reserved value": 0xFFFF_FFF5,
    "upper bits": 0xF000_0009,
    "to a handler, although none is left": 0xFFFF_FFF1,
}


@pytest.mark.parametrize("name", RETURNS)
def test_wrong_return_values(name):
    code = Program()
    code.nop(50)
    code.handler(16)
    code.load(0, RETURNS[name])
    code.bx(0)
    bench = Bench(with_handlers(code).finish())
    bench.write(SHCSR, ENABLE_ALL)
    bench.write(ISER, 1)
    bench.at(5, PULSE, 0)
    bench.run(100)
    assert bench.ipsr == USAGE_FAULT
    assert bench.read(CFSR) == INVPC
    assert bench["lr"] == RETURNS[name]
    assert bench["sp"] == TOP - 32  # chained: no new frame


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
    code.load(0, 0xFFFF_FFF9)
    code.bx(0)
    bench = Bench(code.finish())
    bench.write(SHCSR, ENABLE_ALL)
    bench.write(CCR, 0x200 | allowed)
    bench.write(0xE000E400, 0x4080, 2)
    bench.write(ISER, 3)
    bench.at(5, PULSE, 0)
    bench.at(25, PULSE, 1)
    bench.run(70)
    assert bench.ipsr == (0 if allowed else USAGE_FAULT)
    assert bench.read(CFSR) == (0 if allowed else INVPC)
    assert bench.read(ISER + 0x200) == 1  # of the two, the first is still active


def test_frame_whose_ipsr_does_not_fit():
    code = Program()
    code.nop(50)
    code.handler(16)
    code.half(0x9807)  # LDR r0, [sp, #28]
    code.adds(0, 1)
    code.half(0x9007)  # STR r0, [sp, #28]
    code.bx()
    bench = Bench(with_handlers(code).finish())
    bench.write(SHCSR, ENABLE_ALL)
    bench.write(ISER, 1)
    bench.at(5, PULSE, 0)
    bench.run(100)
    assert bench.ipsr == USAGE_FAULT
    assert bench.read(CFSR) == INVPC


def test_return_of_an_inactive_exception():
    code = Program()
    code.nop(50)
    with_handlers(code).handler(15)
    code.poke(SHCSR, ENABLE_ALL, by=(0, 1))  # clears SysTick's active bit
    code.bx()
    bench = Bench(code.finish())
    bench.write(ICSR, 1 << 26)
    bench.run(100)
    assert bench.ipsr == USAGE_FAULT
    assert bench.read(CFSR) == INVPC


def test_bus_faults_are_ignored_in_the_hard_fault_handler_if_asked():
    code = Program()
    code.half(0xDE00)
    code.handler(3)
    code.load(0, NOWHERE)
    code.movs(1, 5)
    code.ldr(1, 0)
    code.forever()
    bench = Bench(code.finish())
    bench.write(CCR, 0x300)
    bench.run(100)
    assert (bench.ipsr, bench["locked"]) == (3, 0)
    assert bench.read(CFSR) == UNDEFINSTR | PRECISERR | BFARVALID


def test_breakpoint_without_debugger():
    code = Program()
    where = code.bkpt(3)
    bench = Bench(with_handlers(code).finish())
    bench.run(50)
    assert (bench.ipsr, bench.read(HFSR), bench.read(DFSR)) == (3, DEBUGEVT, 2)
    assert bench.word(TOP - 32 + 24) == where


def test_breakpoint_by_the_debug_monitor():
    code = Program()
    code.bkpt(3)
    bench = Bench(with_handlers(code).finish())
    bench.write(DEMCR, 1 << 16)
    bench.run(50)
    assert (bench.ipsr, bench.read(HFSR), bench.read(DFSR)) == (12, 0, 2)


def test_breakpoint_with_a_debugger_stops_in_front_of_it():
    code = Program()
    where = code.bkpt(3)
    bench = Bench(with_handlers(code).finish())
    bench.debugger(0)
    assert bench.run(50) & STOP
    assert (bench["pc"], bench.ipsr, bench["debug_stop"]) == (where, 0, 1)
    assert bench.peek(0xE000EDF0) & 1


def test_a_caught_fault_stops_at_the_handlers_beginning():
    code = Program()
    code.half(0xDE00)
    bench = Bench(with_handlers(code).finish())
    bench.debugger(1 << 10)
    assert bench.run(50) & STOP
    assert (bench.ipsr, bench["debug_stop"]) == (3, 2)
    assert bench["pc"] == int.from_bytes(bytes(bench.code[12:16]), "little") & ~1
    assert bench.read(MMFAR) == 0
