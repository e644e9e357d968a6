"""Entry, return, nesting, chaining and late arrival, by instructions and to the cycle (B1.5)."""

import pytest

from .bench import (
    AIRCR,
    CCR,
    DEMCR,
    DWT,
    ICSR,
    IPR,
    ISER,
    ISPR,
    LINE_HIGH,
    LINES,
    LOG,
    NMI,
    PULSE,
    RAM,
    SHPR2,
    SHPR3,
    STOP,
    VTOR,
    Bench,
)  # fmt: skip
from .thumb import Program

TOP = 0x2000_8000
MARK = 6
"""Register that holds the log's address in these programs."""


def program(*interrupts: int) -> Program:
    """A main program of NOPs with some interrupts enabled, each handler logging its number."""
    code = Program()
    code.load(MARK, LOG)
    code.label("main")
    code.nop(200)
    code.b("main")
    for number in interrupts:
        code.handler(16 + number)
        code.str(MARK, MARK)
        code.nop(3)
        code.bx()
    return code


def start(code: Program, *interrupts: int, priorities: dict[int, int] | None = None) -> Bench:
    """A bench that runs it, interrupts enabled, up to the first NOPs."""
    bench = Bench(code.finish())
    for number in interrupts:
        bench.write(ISER + number // 32 * 4, 1 << number % 32)
    for number, priority in (priorities or {}).items():
        bench.write(IPR + number, priority, 1)
    bench.run(20)
    return bench


def entries(bench: Bench) -> list[tuple[int, int]]:
    """Exceptions in the order of their log entries, and the cycle of the handler's beginning.

    A handler's first instruction is the store, whose data phase is one cycle later.
    """
    return [(entry.exception, entry.cycle - 1) for entry in bench.log]


def test_entry_takes_12_cycles_and_stacks_eight_words():
    bench = start(program(3), 3)
    begin = bench.cycles
    bench["r0"], bench["r1"], bench["r2"], bench["r3"] = 10, 11, 12, 13
    bench["r12"], bench["lr"], bench["xpsr"] = 22, 0x1235, 0xA100_0000
    address = bench["pc"]
    bench.at(begin, PULSE, 3)
    bench.run(13)
    assert entries(bench) == [(19, begin + 12)]
    frame = [bench.word(TOP - 32 + 4 * n) for n in range(8)]
    assert frame == [10, 11, 12, 13, 22, 0x1235, address, 0xA100_0000]
    assert (bench["sp"], bench["lr"], bench.ipsr) == (TOP - 32, 0xFFFF_FFF9, 19)
    bench.run(40)
    assert (bench["sp"], bench["lr"], bench["xpsr"]) == (TOP, 0x1235, 0xA100_0000)
    assert [bench[f"r{n}"] for n in (0, 1, 2, 3, 12)] == [10, 11, 12, 13, 22]


def test_return_takes_10_cycles_behind_the_branch():
    bench = start(program(3), 3)
    begin, at = bench.cycles, bench["pc"]
    bench.at(begin, PULSE, 3)
    bench.run(12 + 1 + 3 + 1 + 10)  # entry, STR, NOPs, BX, return
    assert (bench["pc"], bench.ipsr, bench.cycles) == (at, 0, begin + 27)


@pytest.mark.parametrize("aligned", [True, False])
def test_the_frame_is_aligned_to_eight_bytes_if_stkalign(aligned):
    bench = start(program(3), 3)
    bench.write(CCR, 0x200 * aligned)
    bench["sp"] = TOP - 4
    bench.at(bench.cycles, PULSE, 3)
    bench.run(13)
    assert bench["sp"] == TOP - 4 - 32 - 4 * aligned
    assert bench.word(bench["sp"] + 28) >> 9 & 1 == aligned
    bench.run(40)
    assert bench["sp"] == TOP - 4
    assert bench["xpsr"] & 0x200 == 0


def test_handlers_chain_in_6_cycles_without_popping():
    bench = start(program(3, 4), 3, 4)
    begin = bench.cycles
    bench.at(begin, PULSE, 4)
    bench.at(begin, PULSE, 3)
    bench.run(200)
    first = begin + 12
    assert entries(bench) == [(19, first), (20, first + 1 + 3 + 1 + 6)]
    assert bench["sp"] == TOP


def test_the_more_urgent_one_comes_first_and_preempts():
    code = program(3, 4, 5)
    bench = start(code, 3, 4, 5, priorities={3: 0x80, 4: 0x40, 5: 0x20})
    begin = bench.cycles
    for number in (3, 4):
        bench.at(begin, PULSE, number)
    bench.at(begin + 13, PULSE, 5)  # in the handler of 4
    bench.run(200)
    assert [number for number, _ in entries(bench)] == [20, 21, 19]
    assert entries(bench)[1][1] == begin + 13 + 12
    assert bench.word(TOP - 64 + 28) & 0x1FF == 20  # the nested frame, of the handler


def test_nested_return_value_and_stack():
    bench = start(program(3, 4), 3, 4, priorities={3: 0x80, 4: 0x40})
    begin = bench.cycles
    bench.at(begin, PULSE, 3)
    bench.at(begin + 14, PULSE, 4)
    bench.run(27)
    assert (bench.ipsr, bench["lr"], bench["sp"]) == (20, 0xFFFF_FFF1, TOP - 64)
    assert bench.read(ICSR) >> 11 & 1 == 0  # RETTOBASE
    bench.run(200)
    assert (bench.ipsr, bench["sp"]) == (0, TOP)


@pytest.mark.parametrize(("delay", "late"), [(1, True), (6, True), (7, False), (11, False)])
def test_a_late_one_takes_over_the_frame(delay, late):
    bench = start(program(3, 4), 3, 4, priorities={3: 0x80, 4: 0x40})
    begin = bench.cycles
    bench.at(begin, PULSE, 3)
    bench.at(begin + delay, PULSE, 4)
    bench.run(200)
    order = entries(bench)
    if late:  # 12 cycles for the first, and no second frame
        assert order == [(20, begin + 12), (19, begin + 12 + 5 + 6)]
    else:  # preempted before its first instruction, which comes when 4 returns
        assert [number for number, _ in order] == [20, 19]
        assert order[0][1] == begin + 24


def test_a_late_one_of_the_same_priority_waits():
    bench = start(program(3, 4), 3, 4)
    begin = bench.cycles
    bench.at(begin, PULSE, 4)
    bench.at(begin + 3, PULSE, 3)
    bench.run(200)
    # Among equals the lower number wins as long as none is active.
    assert [number for number, _ in entries(bench)] == [19, 20]


def test_one_that_comes_while_the_frame_is_read_chains():
    bench = start(program(3, 4), 3, 4)
    begin = bench.cycles
    bench.at(begin, PULSE, 3)
    popping = begin + 12 + 5
    bench.at(popping + 2, PULSE, 4)
    bench.run(200)
    assert entries(bench)[1] == (20, popping + 4 + 6)


def test_masks_hold_back_what_is_not_more_urgent():
    bench = start(program(3, 4), 3, 4, priorities={3: 0x80, 4: 0x40})
    bench["basepri"] = 0x80
    bench.at(bench.cycles, PULSE, 3)
    bench.run(50)
    assert entries(bench) == []
    bench.at(bench.cycles, PULSE, 4)
    bench.run(50)
    assert [number for number, _ in entries(bench)] == [20]
    bench["primask"] = 1
    bench["basepri"] = 0
    bench.at(bench.cycles, PULSE, 4)
    bench.run(50)
    assert len(bench.log) == 1
    bench["primask"] = 0
    bench.run(80)
    assert [number for number, _ in entries(bench)] == [20, 20, 19]


def test_faultmask_is_cleared_by_the_return():
    code = Program()
    code.load(MARK, LOG)
    code.svc()
    code.mrs(0, "faultmask")
    code.forever()
    code.handler(11)
    code.cps(False, fault=True)
    code.mrs(1, "faultmask")
    code.str(1, MARK)
    code.bx()
    bench = Bench(code.finish())
    bench.run(100)
    assert (bench.log[0].value, bench["faultmask"], bench["r0"]) == (1, 0, 0)


def test_svc_returns_behind_itself_and_pendsv_comes_after():
    code = Program()
    code.load(MARK, LOG)
    code.poke(ICSR, 1 << 28, by=(0, 1))
    code.svc(7)
    after = code.forever()
    code.handler(11)
    code.str(0, MARK)
    code.bx()
    code.handler(14)
    code.str(0, MARK)
    code.bx()
    bench = Bench(code.finish())
    bench["primask"] = 0
    bench.write(SHPR3, 0xE0 << 16)
    bench.run(200)
    assert [entry.exception for entry in bench.log] == [14, 11]
    assert bench.word(TOP - 32 + 24) == after
    assert bench["pc"] == after


def test_svc_that_may_not_be_taken_is_a_hard_fault():
    code = Program()
    code.svc()
    code.handler(3)
    code.forever()
    bench = Bench(code.finish())
    bench.write(SHPR2, 0x80 << 24)
    bench["basepri"] = 0x80
    bench.run(100)
    assert bench.ipsr == 3
    assert bench.fault.hfsr == 1 << 30


def test_nmi_preempts_the_hard_fault_handler():
    code = Program()
    code.half(0xDE00)  # undefined
    code.handler(3)
    code.forever()
    code.handler(2)
    code.load(MARK, LOG)
    code.str(MARK, MARK)
    code.bx()
    bench = Bench(code.finish())
    bench.run(50)
    assert (bench.ipsr, bench["priority"]) == (3, 0xFFFF_FFFF)
    bench.at(bench.cycles, NMI)
    bench.run(50)
    assert bench.log[0].exception == 2
    assert bench.ipsr == 3


def test_process_stack_and_unprivileged_thread():
    code = program(3)
    bench = start(code, 3)
    bench["psp"] = TOP - 0x1000
    bench["control"] = 3
    main = bench["msp"]
    bench.at(bench.cycles, PULSE, 3)
    bench.run(13)
    assert bench["lr"] == 0xFFFF_FFFD
    assert bench["sp"] == main
    assert bench["psp"] == TOP - 0x1000 - 32
    assert bench["control"] == 1  # privileged by mode; SPSEL is clear in a handler
    bench.run(50)
    assert (bench["control"], bench["sp"]) == (3, TOP - 0x1000)


def test_tasks_are_switched_by_pendsv():
    """What an operating system does: the handler changes PSP, and returns to another task."""
    code = Program()
    code.load(0, 0x2000_4000)
    code.msr("psp", 0)
    code.movs(0, 2)
    code.msr("control", 0)
    code.half(0xF3BF, 0x8F6F)  # ISB
    code.load(MARK, LOG)
    code.movs(0, 1)
    code.load(1, ICSR)
    code.load(2, 1 << 28)
    code.str(2, 1)
    code.label("first")
    code.str(0, MARK)
    code.b("first")
    other = code.movs(0, 2)
    code.label("second")
    code.str(0, MARK)
    code.b("second")
    code.handler(14)
    code.load(3, 0x2000_5000 - 32)
    code.msr("psp", 3)
    code.bx()
    bench = Bench(code.finish())
    frame = [0, 0, 0, 0, 0, 0xFFFF_FFFF, other, 1 << 24]
    for n, word in enumerate(frame):
        at = 0x5000 - 32 + 4 * n
        bench.ram[at : at + 4] = list(word.to_bytes(4, "little"))
    bench["r6"] = LOG
    bench.run(300)
    values = {entry.value for entry in bench.log}
    assert 2 in values
    assert bench.log[-1].value == 2
    assert bench["sp"] == 0x2000_5000


def test_vector_table_moves():
    code = program(3)
    bench = start(code, 3)
    moved = bytearray(bench.code[:0x100])
    bench.ram[0x400:0x500] = list(moved)
    bench.write(VTOR, RAM + 0x47F)
    assert bench.read(VTOR) == RAM + 0x400
    bench.code[4 * 19 : 4 * 20] = [0] * 4
    bench.at(bench.cycles, PULSE, 3)
    bench.run(13)
    assert bench.ipsr == 19


def test_level_interrupt_runs_until_its_handler_acknowledges():
    code = Program()
    code.load(MARK, LOG)
    code.movs(4, 0)
    code.forever()
    code.handler(16 + 7)
    code.adds(4, 1)
    code.str(4, MARK)
    code.half(0x2C03)  # CMP r4, #3
    code.b("stay", 1)
    code.load(0, LINES + 4 * 7)
    code.movs(1, 0)
    code.str(1, 0)
    code.label("stay")
    code.bx()
    bench = Bench(code.finish())
    bench.write(ISER, 1 << 7)
    bench.run(10)
    bench.at(bench.cycles, LINE_HIGH, 7)
    bench.run(300)
    assert [entry.value for entry in bench.log] == [1, 2, 3]
    assert (bench.ipsr, bench.read(ISPR)) == (0, 0)


def test_exception_counter_and_cycle_counter():
    bench = start(program(3), 3)
    bench.write(DEMCR, 1 << 24)
    bench.write(DWT + 4, 0)
    bench.write(DWT, 1 | 1 << 18)
    begin = bench.cycles
    bench.at(begin, PULSE, 3)
    bench.run(100)
    assert bench.read(DWT + 4) == bench.cycles - begin
    assert bench.read(DWT + 12) == 22
    bench.write(DEMCR, 0)  # stands without TRCENA
    stood = bench.read(DWT + 4)
    bench.run(10)
    assert bench.read(DWT + 4) == stood


@pytest.mark.parametrize("value", [0x05FA_0004, 0x05FA_0001])
def test_reset_request_stops_the_run(value):
    code = Program()
    code.load(0, AIRCR)
    code.load(1, value)
    code.str(1, 0)
    code.forever()
    bench = Bench(code.finish())
    assert bench.run(100) & STOP
    assert bench["resets"] == 1
    bench.write(AIRCR, 0x0004)
    assert bench["resets"] == 1  # the key is missing
