"""WFI, WFE, SEV and sleep on exit: wake-up events and their times (B1.5.17 to B1.5.19)."""

import pytest

from .bench import LOG, PULSE, SLEEP, SYSTEM, Bench
from .thumb import store

WFI, WFE, ON_EXIT = 1, 2, 3


def sleeping(instruction: str, enabled: bool = True) -> Bench:
    """A bench that sleeps, then writes to the log; so does the handler."""
    bench = Bench(f"ldr r6, ={LOG}; {instruction}; str r6, [r6]; b .; @16: str r6, [r6]; bx lr")
    bench["ISER"] = 1 * enabled
    assert bench.run(50) & SLEEP
    return bench


@pytest.mark.parametrize(("instruction", "state"), [("wfi", WFI), ("wfe", WFE)])
def test_interrupt_wakes_and_is_taken(instruction, state):
    bench = sleeping(instruction)
    assert bench["sleep"] == state
    bench.run(1000)
    assert bench.log == []
    begin = bench.cycles + 100
    bench.at(begin, PULSE, 0)
    bench.run(200)
    assert (bench.log[0].exception, bench.log[0].cycle) == (16, begin + 13)
    assert bench.log[1].exception == 0


def test_interrupt_masked_by_primask_wakes_from_wfi():
    bench = sleeping("cpsid i; wfi")
    bench.at(bench.cycles + 100, PULSE, 0)
    bench.run(200)
    assert [entry.exception for entry in bench.log] == [0]


def test_interrupt_masked_by_basepri_does_not_wake_from_wfi():
    bench = sleeping("wfi")
    bench["basepri"] = 0x20
    bench.write(0xE000E400, 0x40, 1)
    bench.at(bench.cycles + 10, PULSE, 0)
    bench.run(100)
    assert bench["sleep"] == WFI


def test_wfi_continues_at_once_with_a_pending_interrupt():
    bench = Bench(f"cpsid i; {store(SYSTEM['ISPR'], 1)}; wfi; after: b .")
    bench["ISER"] = 1
    bench.run(40)
    assert (bench["pc"], bench["sleep"]) == (bench.labels["after"], 0)


def test_wfe_consumes_events_of_sev_and_exceptions():
    after_sev = f"ldr r6, ={LOG}; sev; wfe; str r6, [r6]"
    after_svc = "svc #0; wfe; str r6, [r6]"  # exception entry and return set the event
    bench = Bench(f"{after_sev}; {after_svc}; wfe; str r6, [r6]; @11: bx lr")
    bench.run(200)
    assert (len(bench.log), bench["sleep"]) == (2, WFE)


@pytest.mark.parametrize("sev_on_pend", [False, True])
def test_disabled_interrupt_wakes_from_wfe_with_sevonpend(sev_on_pend):
    bench = sleeping("cpsid i; wfe", enabled=False)
    bench["SCR"] = 0x10 * sev_on_pend
    bench.at(bench.cycles + 100, PULSE, 0)
    bench.run(200)
    assert [entry.exception for entry in bench.log] == [0] * sev_on_pend


def test_waking_event_is_consumed():
    bench = Bench(f"ldr r6, ={LOG}; cpsid i; wfe; str r6, [r6]; wfe; str r6, [r6]")
    bench["SCR"] = 0x10
    bench.run(50)
    bench.at(bench.cycles + 10, PULSE, 0)
    bench.run(200)
    assert (len(bench.log), bench["sleep"]) == (1, WFE)


def test_sleep_on_exit_runs_only_handlers():
    bench = sleeping("wfi")
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
    bench = sleeping("wfi")
    bench.write(SYSTEM["SYSTICK"] + 4, 999)
    bench.write(SYSTEM["SYSTICK"] + 8, 0)
    bench["SYSTICK"] = 7
    bench.run(1100)
    assert bench["sleep"] == 0
    assert bench["ICSR"] & 0x1FF == 3  # there is no handler: BKPT
