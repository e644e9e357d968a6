"""WFI, WFE, SEV, sleep on exit: what wakes, and when (B1.5.17 to B1.5.19)."""

import pytest

from .bench import ICSR, ISER, ISPR, LOG, PULSE, SCR, SLEEP, SYSTICK, Bench
from .thumb import Program

WFI, WFE, ON_EXIT = 1, 2, 3


def sleeping(instruction: str, masked: bool = False) -> Program:
    """Sleeps, then logs; the handler logs, too."""
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
    """A bench that has fallen asleep."""
    bench = Bench(code.finish())
    bench.write(ISER, 1 * enabled)
    assert bench.run(50) & SLEEP
    return bench


@pytest.mark.parametrize(("instruction", "state"), [("wfi", WFI), ("wfe", WFE)])
def test_an_interrupt_wakes_and_is_taken(instruction, state):
    bench = start(sleeping(instruction))
    assert bench["sleep"] == state
    bench.run(1000)
    assert bench.log == []
    begin = bench.cycles + 100
    bench.at(begin, PULSE, 0)
    bench.run(200)
    assert (bench.log[0].exception, bench.log[0].cycle) == (16, begin + 13)
    assert bench.log[1].exception == 0


def test_wfi_wakes_of_an_interrupt_that_primask_holds_back():
    bench = start(sleeping("wfi", masked=True))
    bench.at(bench.cycles + 100, PULSE, 0)
    bench.run(200)
    assert [entry.exception for entry in bench.log] == [0]


def test_wfi_does_not_wake_of_what_basepri_holds_back():
    bench = start(sleeping("wfi"))
    bench["basepri"] = 0x20
    bench.write(0xE000E400, 0x40, 1)
    bench.at(bench.cycles + 10, PULSE, 0)
    bench.run(100)
    assert bench["sleep"] == WFI


def test_wfi_goes_on_at_once_if_something_is_pending():
    code = Program()
    code.cps(False)
    code.load(0, ISPR)
    code.movs(1, 1)
    code.str(1, 0)
    code.wfi()
    where = code.forever()
    bench = Bench(code.finish())
    bench.write(ISER, 1)
    bench.run(40)
    assert (bench["pc"], bench["sleep"]) == (where, 0)


def test_wfe_takes_the_event_of_sev_and_of_exceptions():
    code = Program()
    code.load(6, LOG)
    code.sev()
    code.wfe()
    code.str(6, 6)
    code.svc()
    code.wfe()  # entry and return have set the event
    code.str(6, 6)
    code.wfe()
    code.str(6, 6)
    code.handler(11)
    code.bx()
    bench = Bench(code.finish())
    bench.run(200)
    assert (len(bench.log), bench["sleep"]) == (2, WFE)


@pytest.mark.parametrize("sev_on_pend", [False, True])
def test_wfe_wakes_of_a_disabled_interrupt_if_sevonpend(sev_on_pend):
    bench = start(sleeping("wfe", masked=True), enabled=False)
    bench.write(SCR, 0x10 * sev_on_pend)
    bench.at(bench.cycles + 100, PULSE, 0)
    bench.run(200)
    assert [entry.exception for entry in bench.log] == [0] * sev_on_pend


def test_an_event_that_woke_is_used_up():
    code = Program()
    code.load(6, LOG)
    code.cps(False)
    for _ in range(2):
        code.wfe()
        code.str(6, 6)
    bench = Bench(code.finish())
    bench.write(SCR, 0x10)
    bench.run(50)
    bench.at(bench.cycles + 10, PULSE, 0)
    bench.run(200)
    assert (len(bench.log), bench["sleep"]) == (1, WFE)


def test_sleep_on_exit_runs_handlers_only():
    bench = start(sleeping("wfi"))
    bench.write(SCR, 2)
    for delay in (100, 300):
        bench.at(bench.cycles + delay, PULSE, 0)
    bench.run(1000)
    assert [entry.exception for entry in bench.log] == [16, 16]
    assert bench["sleep"] == ON_EXIT
    bench.write(SCR, 0)
    bench.at(bench.cycles + 10, PULSE, 0)
    bench.run(100)
    assert [entry.exception for entry in bench.log] == [16, 16, 16, 0]


def test_systick_wakes():
    bench = start(sleeping("wfi"))
    bench.write(SYSTICK + 4, 999)
    bench.write(SYSTICK + 8, 0)
    bench.write(SYSTICK, 7)
    begin = bench.cycles
    bench.cycles = begin
    bench.run(1100)
    assert bench["sleep"] == 0
    assert bench.read(ICSR) & 0x1FF == 3  # there is no handler: BKPT
