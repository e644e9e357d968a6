"""Exception entry, return, nesting, tail-chaining and late arrival, to the cycle (B1.5)."""

import pytest

from .bench import LINE_HIGH, LINES, LOG, NMI, PULSE, RAM, STOP, SYSTEM, Bench
from .thumb import store

TOP = 0x2000_8000
LOGS = f"ldr r6, ={LOG}"
"""r6 holds the log's address in these programs."""


def start(*interrupts: int, priorities: dict[int, int] | None = None) -> Bench:
    """A bench at NOPs with interrupts enabled, whose handlers write to the log."""
    handlers = [f"@{16 + number}: str r6, [r6]; nop #3; bx lr" for number in interrupts]
    bench = Bench("; ".join((LOGS, "main: nop #200; b main", *handlers)))
    for number in interrupts:
        bench.write(SYSTEM["ISER"] + number // 32 * 4, 1 << number % 32)
    for number, priority in (priorities or {}).items():
        bench.write(SYSTEM["IPR"] + number, priority, 1)
    bench.run(20)
    return bench


def pulse(bench: Bench, *pulses: tuple[int, int], run: int = 200) -> int:
    """Pulse interrupts, (delay, number) each, and run; returns the cycle of delay 0."""
    begin = bench.cycles
    for delay, number in pulses:
        bench.at(begin + delay, PULSE, number)
    bench.run(run)
    return begin


def entries(bench: Bench) -> list[tuple[int, int]]:
    """Exceptions by log entry, each with the cycle of its handler's first instruction.

    That is the store to the log, whose data phase is one cycle later.
    """
    return [(entry.exception, entry.cycle - 1) for entry in bench.log]


def numbers(bench: Bench) -> list[int]:
    return [entry.exception for entry in bench.log]


def test_entry_takes_12_cycles_and_stacks_eight_words():
    bench = start(3)
    values = {"r0": 10, "r1": 11, "r2": 12, "r3": 13, "r12": 22, "lr": 0x1235}
    for name, value in values.items():
        bench[name] = value
    bench["xpsr"] = 0xA100_0000
    address = bench["pc"]
    begin = pulse(bench, (0, 3), run=13)
    assert entries(bench) == [(19, begin + 12)]
    frame = [bench.word(TOP - 32 + 4 * n) for n in range(8)]
    assert frame == [*values.values(), address, 0xA100_0000]
    assert (bench["sp"], bench["lr"], bench.ipsr) == (TOP - 32, 0xFFFF_FFF9, 19)
    bench.run(40)
    assert (bench["sp"], bench["xpsr"]) == (TOP, 0xA100_0000)
    assert {name: bench[name] for name in values} == values


def test_return_takes_10_cycles_after_the_branch():
    bench = start(3)
    at = bench["pc"]
    begin = pulse(bench, (0, 3), run=12 + 1 + 3 + 1 + 10)  # entry, STR, NOPs, BX, return
    assert (bench["pc"], bench.ipsr, bench.cycles) == (at, 0, begin + 27)


@pytest.mark.parametrize("aligned", [True, False])
def test_stkalign_aligns_the_frame_to_eight_bytes(aligned):
    bench = start(3)
    bench["CCR"] = 0x200 * aligned
    bench["sp"] = TOP - 4
    pulse(bench, (0, 3), run=13)
    assert bench["sp"] == TOP - 4 - 32 - 4 * aligned
    assert bench.word(bench["sp"] + 28) >> 9 & 1 == aligned
    bench.run(40)
    assert (bench["sp"], bench["xpsr"] & 0x200) == (TOP - 4, 0)


def test_tail_chaining_takes_6_cycles_without_unstacking():
    bench = start(3, 4)
    begin = pulse(bench, (0, 4), (0, 3))
    first = begin + 12
    assert entries(bench) == [(19, first), (20, first + 1 + 3 + 1 + 6)]
    assert bench["sp"] == TOP


def test_higher_priority_is_taken_first_and_preempts():
    bench = start(3, 4, 5, priorities={3: 0x80, 4: 0x40, 5: 0x20})
    begin = pulse(bench, (0, 3), (0, 4), (13, 5))  # the last one in the handler of 4
    assert numbers(bench) == [20, 21, 19]
    assert entries(bench)[1][1] == begin + 13 + 12
    assert bench.word(TOP - 64 + 28) & 0x1FF == 20  # xPSR in the nested frame


def test_nested_handler_has_its_return_value_and_frame():
    bench = start(3, 4, priorities={3: 0x80, 4: 0x40})
    pulse(bench, (0, 3), (14, 4), run=27)
    assert (bench.ipsr, bench["lr"], bench["sp"]) == (20, 0xFFFF_FFF1, TOP - 64)
    assert bench["ICSR"] >> 11 & 1 == 0  # RETTOBASE
    bench.run(200)
    assert (bench.ipsr, bench["sp"]) == (0, TOP)


@pytest.mark.parametrize(("delay", "late"), [(1, True), (6, True), (7, False), (11, False)])
def test_late_arrival_takes_over_the_frame(delay, late):
    bench = start(3, 4, priorities={3: 0x80, 4: 0x40})
    begin = pulse(bench, (0, 3), (delay, 4))
    if late:  # 12 cycles for the first, and no second frame
        assert entries(bench) == [(20, begin + 12), (19, begin + 12 + 5 + 6)]
    else:  # preempted before its first instruction, which comes when 4 returns
        assert numbers(bench) == [20, 19]
        assert entries(bench)[0][1] == begin + 24


def test_late_arrival_of_the_same_priority_with_a_lower_number_is_taken_first():
    bench = start(3, 4)
    pulse(bench, (0, 4), (3, 3))
    assert numbers(bench) == [19, 20]


def test_exception_during_unstacking_is_tail_chained():
    bench = start(3, 4)
    unstacking = 12 + 5
    begin = pulse(bench, (0, 3), (unstacking + 2, 4))
    assert entries(bench)[1] == (20, begin + unstacking + 4 + 6)


def test_masks_hold_back_exceptions_of_lower_priority():
    bench = start(3, 4, priorities={3: 0x80, 4: 0x40})
    bench["basepri"] = 0x80
    pulse(bench, (0, 3), run=50)
    assert numbers(bench) == []
    pulse(bench, (0, 4), run=50)
    assert numbers(bench) == [20]
    bench["primask"] = 1
    bench["basepri"] = 0
    pulse(bench, (0, 4), run=50)
    assert len(bench.log) == 1
    bench["primask"] = 0
    bench.run(80)
    assert numbers(bench) == [20, 20, 19]


def test_exception_return_clears_faultmask():
    handler = "@11: cpsid f; mrs r1, faultmask; str r1, [r6]; bx lr"
    bench = Bench(f"{LOGS}; svc #0; mrs r0, faultmask; b .; {handler}")
    bench.run(100)
    assert (bench.log[0].value, bench["faultmask"], bench["r0"]) == (1, 0, 0)


def test_svc_returns_to_the_next_instruction_and_pendsv_is_taken_before():
    handlers = "@11: str r0, [r6]; bx lr; @14: str r0, [r6]; bx lr"
    pend = store(SYSTEM["ICSR"], 1 << 28)
    bench = Bench(f"{LOGS}; {pend}; svc #7; after: b .; {handlers}")
    after = bench.labels["after"]
    bench["primask"] = 0
    bench["SHPR3"] = 0xE0 << 16
    bench.run(200)
    assert (numbers(bench), bench.word(TOP - 32 + 24)) == ([14, 11], after)
    assert bench["pc"] == after


def test_masked_svc_is_a_hard_fault():
    bench = Bench("svc #0; @3: b .")
    bench["SHPR2"] = 0x80 << 24
    bench["basepri"] = 0x80
    bench.run(100)
    assert bench.ipsr == 3
    assert bench.fault.hfsr == 1 << 30


def test_nmi_preempts_the_hard_fault_handler():
    bench = Bench(f"udf #0; @3: b .; @2: {LOGS}; str r6, [r6]; bx lr")
    bench.run(50)
    assert (bench.ipsr, bench["priority"]) == (3, 0xFFFF_FFFF)
    bench.at(bench.cycles, NMI)
    bench.run(50)
    assert (bench.log[0].exception, bench.ipsr) == (2, 3)


def test_exception_of_an_unprivileged_thread_uses_the_main_stack():
    bench = start(3)
    bench["psp"] = TOP - 0x1000
    bench["control"] = 3
    main = bench["msp"]
    pulse(bench, (0, 3), run=13)
    assert (bench["lr"], bench["sp"]) == (0xFFFF_FFFD, main)
    assert bench["psp"] == TOP - 0x1000 - 32
    assert bench["control"] == 1  # privileged by mode; SPSEL is clear in a handler
    bench.run(50)
    assert (bench["control"], bench["sp"]) == (3, TOP - 0x1000)


def test_pendsv_switches_tasks():
    """As an operating system does: the handler changes PSP and returns to another task."""
    stack = "ldr r0, =0x20004000; msr psp, r0; movs r0, #2; msr control, r0; isb"
    pend = store(SYSTEM["ICSR"], 1 << 28)
    first = f"{LOGS}; {pend}; movs r0, #1; first: str r0, [r6]; b first"
    second = "other: movs r0, #2; second: str r0, [r6]; b second"
    switch = f"@14: ldr r3, ={0x2000_5000 - 32}; msr psp, r3; bx lr"
    bench = Bench(f"{stack}; {first}; {second}; {switch}")
    for n, word in enumerate([0, 0, 0, 0, 0, 0xFFFF_FFFF, bench.labels["other"], 1 << 24]):
        at = 0x5000 - 32 + 4 * n
        bench.ram[at : at + 4] = list(word.to_bytes(4, "little"))
    bench["r6"] = LOG
    bench.run(300)
    assert (bench.log[-1].value, bench["sp"]) == (2, 0x2000_5000)


def test_vtor_moves_the_vector_table():
    bench = start(3)
    bench.ram[0x400:0x500] = list(bench.code[:0x100])
    bench["VTOR"] = RAM + 0x47F
    assert bench["VTOR"] == RAM + 0x400
    bench.code[4 * 19 : 4 * 20] = [0] * 4
    pulse(bench, (0, 3), run=13)
    assert bench.ipsr == 19


def test_level_interrupt_repeats_until_its_handler_clears_the_line():
    count = "@23: adds r4, #1; str r4, [r6]; cmp r4, #3; bne stay"
    clear = f"{store(LINES + 4 * 7, 0)}; stay: bx lr"
    bench = Bench(f"{LOGS}; movs r4, #0; b .; {count}; {clear}")
    bench["ISER"] = 1 << 7
    bench.run(10)
    bench.at(bench.cycles, LINE_HIGH, 7)
    bench.run(300)
    assert [entry.value for entry in bench.log] == [1, 2, 3]
    assert (bench.ipsr, bench["ISPR"]) == (0, 0)


def test_dwt_counts_exceptions_and_cycles_while_enabled():
    bench = start(3)
    bench["DEMCR"] = 1 << 24
    bench["CYCCNT"] = 0
    bench["DWT"] = 1 | 1 << 18
    begin = pulse(bench, (0, 3), run=100)
    assert (bench["CYCCNT"], bench["EXCCNT"]) == (bench.cycles - begin, 22)
    bench["DEMCR"] = 0  # stops without TRCENA
    stopped = bench["CYCCNT"]
    bench.run(10)
    assert bench["CYCCNT"] == stopped


@pytest.mark.parametrize("value", [0x05FA_0004, 0x05FA_0001])
def test_reset_request_stops_the_run(value):
    bench = Bench(f"{store(SYSTEM['AIRCR'], value)}; b .")
    assert bench.run(100) & STOP
    assert bench["resets"] == 1
    bench["AIRCR"] = 0x0004
    assert bench["resets"] == 1  # the key is missing
