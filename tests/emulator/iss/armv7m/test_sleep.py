"""WFI, WFE, SEV and sleep on exit: wake-up events and their times (B1.5.17 to B1.5.19)."""

import pytest

from .bench import LOG, PULSE, SLEEP, SYSTEM, Bench
from .thumb import Program

WFI, WFE, ON_EXIT = 1, 2, 3


def sleeping(instruction: str, masked: bool = False) -> Program:
    """A program that sleeps, then writes to the log; so does the handler."""
    code = Program()
    code.load(6, LOG)
    if masked:
        code.cps(False)
    getattr(code, instruction)()
    code.str(6, 6)
    code.forever()
    code.handler(16)
    code.str(6, 6)
    code.bx()
    return code


def start(code: Program, enabled: bool = True) -> Bench:
    """A sleeping bench."""
    bench = Bench(code.finish())
    bench["ISER"] = 1 * enabled
    assert bench.run(50) & SLEEP
    return bench


@pytest.mark.parametrize(("instruction", "state"), [("wfi", WFI), ("wfe", WFE)])
def test_interrupt_wakes_and_is_taken(instruction, state):
    bench = start(sleeping(instruction))
    assert bench["sleep"] == state
    bench.run(1000)
    assert bench.log == []
    begin = bench.cycles + 100
    bench.at(begin, PULSE, 0)
    bench.run(200)
    assert (bench.log[0].exception, bench.log[0].cycle) == (16, begin + 13)
    assert bench.log[1].exception == 0


def test_interrupt_masked_by_primask_wakes_from_wfi():
    bench = start(sleeping("wfi", masked=True))
    bench.at(bench.cycles + 100, PULSE, 0)
    bench.run(200)
    assert [entry.exception for entry in bench.log] == [0]


def test_interrupt_masked_by_basepri_does_not_wake_from_wfi():
    bench = start(sleeping("wfi"))
    bench["basepri"] = 0x20
    bench.write(0xE000E400, 0x40, 1)
    bench.at(bench.cycles + 10, PULSE, 0)
    bench.run(100)
    assert bench["sleep"] == WFI


def test_wfi_continues_at_once_with_a_pending_interrupt():
    code = Program()
    code.cps(False)
    code.load(0, SYSTEM["ISPR"])
    code.movs(1, 1)
    code.str(1, 0)
    code.wfi()
    where = code.forever()
    bench = Bench(code.finish())
    bench["ISER"] = 1
    bench.run(40)
    assert (bench["pc"], bench["sleep"]) == (where, 0)


def test_wfe_consumes_events_of_sev_and_exceptions():
    code = Program()
    code.load(6, LOG)
    code.sev()
    code.wfe()
    code.str(6, 6)
    code.svc()
    code.wfe()  # exception entry and return set the event
    code.str(6, 6)
    code.wfe()
    code.str(6, 6)
    code.handler(11)
    code.bx()
    bench = Bench(code.finish())
    bench.run(200)
    assert (len(bench.log), bench["sleep"]) == (2, WFE)


@pytest.mark.parametrize("sev_on_pend", [False, True])
def test_disabled_interrupt_wakes_from_wfe_with_sevonpend(sev_on_pend):
    bench = start(sleeping("wfe", masked=True), enabled=False)
    bench["SCR"] = 0x10 * sev_on_pend
    bench.at(bench.cycles + 100, PULSE, 0)
    bench.run(200)
    assert [entry.exception for entry in bench.log] == [0] * sev_on_pend


def test_waking_event_is_consumed():
    code = Program()
    code.load(6, LOG)
    code.cps(False)
    for _ in range(2):
        code.wfe()
        code.str(6, 6)
    bench = Bench(code.finish())
    bench["SCR"] = 0x10
    bench.run(50)
    bench.at(bench.cycles + 10, PULSE, 0)
    bench.run(200)
    assert (len(bench.log), bench["sleep"]) == (1, WFE)


def test_sleep_on_exit_runs_only_handlers():
    bench = start(sleeping("wfi"))
    bench["SCR"] = 2
    for delay in (100, 300):
        bench.at(bench.cycles + delay, PULSE, 0)
    bench.run(1000)
    assert [entry.exception for entry in bench.log] == [16, 16]
    assert bench["sleep"] == ON_EXIT
    bench["SCR"] = 0
    bench.at(bench.cycles + 10, PULSE, 0)
    bench.run(100)
    assert [entry.exception for entry in bench.log] == [16, 16, 16, 0]


def test_systick_wakes_from_wfi():
    bench = start(sleeping("wfi"))
    bench.write(SYSTEM["SYSTICK"] + 4, 999)
    bench.write(SYSTEM["SYSTICK"] + 8, 0)
    bench["SYSTICK"] = 7
    bench.run(1100)
    assert bench["sleep"] == 0
    assert bench["ICSR"] & 0x1FF == 3  # there is no handler: BKPT
