"""The processor's requests: every duration counted by hand, a cycle is a microsecond."""

import numpy as np
import pytest

from cubestack.emulator.sim.processor import LOOK_AHEAD_PS, RequestError
from cubestack.emulator.sim.virtual_time import PS_PER_S, PS_PER_US
from cubestack.firmware_model.mcu import requests as req

from ..conftest import BOOT_US, POWER_ON, script

PORT_WRITE, PORT_READ, POLL = 2, 3, 7


def awaiting(level: int = 1, timeout_us: int = 500_000) -> req.AwaitPin:
    return req.AwaitPin("ACK", level, timeout_us, POLL)


def sleep(deadline_us: int, wakeable: bool = True) -> req.Sleep:
    return req.Sleep(deadline_us + BOOT_US, wakeable)


PAY, READ_ACK = req.Pay(), req.ReadPin("ACK")
ACK_SEEN_US = {1: 7, 6: 7, 7: 7, 8: 14, 700: 700, 701: 707, 386_002: 386_008}
BEFORE = -BOOT_US
CASES = {
    "charged cycles come first": ((7, PAY, 5, req.ReadTimer()), {}, [(7, None), (12, 112)]),
    "no cycles take no time": ((PAY,), {}, [(0, None)]),
    "interrupts extend the work, also that of interrupts, and are too late when it is done": (
        (100, PAY),
        {"work": {60: 20, 110: 3, 124: 1000}},
        [(123, None)],
    ),
    "a pin is read when the work before it is done": (
        (READ_ACK, 10, READ_ACK),
        {"ack": [5]},
        [(0, 0), (PORT_READ + 10, 1)],
    ),
    **{
        f"ACK at {rose} us is seen at the end of a poll": (
            (awaiting(),),
            {"ack": [rose]},
            [(seen, True)],
        )
        for rose, seen in ACK_SEEN_US.items()
    },
    "a pin that is there already costs one poll": ((awaiting(level=0),), {}, [(POLL, True)]),
    "a pin that never comes": ((awaiting(timeout_us=12_345),), {}, [(12_345, False)]),
    "a pin at the timeout": ((awaiting(timeout_us=100),), {"ack": [100]}, [(105, True)]),
    "a pin after the timeout": ((awaiting(timeout_us=99),), {"ack": [100]}, [(99, False)]),
    "interrupts during a poll are paid afterwards": (
        (awaiting(), PAY),
        {"ack": [70], "work": {30: 25}},
        [(70, True), (95, None)],
    ),
    "interrupts during a sleep are paid afterwards": (
        (sleep(500), PAY),
        {"work": {200: 30}},
        [(500, False), (530, None)],
    ),
    "a sleep ends at its deadline": ((sleep(500),), {}, [(500, False)]),
    "a wake ends a sleep": ((sleep(500),), {"wake": [200]}, [(200, True)]),
    "a sleep goes on when it is not wakeable, and the wake is kept": (
        (sleep(500, wakeable=False), sleep(900)),
        {"wake": [200]},
        [(500, False), (500, True)],
    ),
    "a wake before a sleep is not lost": (
        (sleep(500), sleep(900)),
        {"wake": [BEFORE]},
        [(0, True), (900, False)],
    ),
    "two wakes end one sleep": (
        (sleep(500), sleep(900)),
        {"wake": [100, 100]},
        [(100, True), (900, False)],
    ),
    "a wake survives a sleep whose deadline has passed": (
        (sleep(0), sleep(900)),
        {"wake": [BEFORE]},
        [(0, False), (0, True)],
    ),
}


@pytest.mark.parametrize(("steps", "events", "log"), CASES.values(), ids=CASES)
def test_processor_answers_each_request_at_its_time(desk_of, steps, events, log):
    desk = desk_of(script(*steps))
    desk.ack_at(*events.get("ack", ()))
    for us, cycles in events.get("work", {}).items():
        desk.at(us, lambda cycles=cycles: desk.work(cycles))
    for us in events.get("wake", ()):
        desk.at(us, desk.processor.wake)
    assert desk.run().log == log


def test_main_starts_after_the_boot_time(desk_of):
    desk = desk_of(script(PAY))
    desk.kernel.advance_to(BOOT_US * PS_PER_US - 1)
    assert not desk.log
    assert desk.run().log == [(0, None)]
    assert desk.causes == [POWER_ON]


def test_pin_changes_after_the_preceding_work(desk_of):
    desk = desk_of(script(10, req.SetPin("ENABLE", 1), req.SetPin("RNW", 1))).run()
    rises = [((time // PS_PER_US) - BOOT_US, pin, level) for time, pin, level in desk.engine.pins]
    assert rises == [(10, "ENABLE", 1), (10 + PORT_WRITE, "RNW", 1)]
    assert desk.pins_told == [("ENABLE", 1), ("RNW", 1)]
    assert desk.log[0] == (10, None)


def test_pins_outside_the_fpga_reach_the_board_only(desk_of):
    steps = (req.SetPin("LINE", 1), req.ReadPin("LINE"), req.SetPin("LINE", 0), req.ReadPin("LINE"))
    desk = desk_of(script(*steps)).run()
    first, second = PORT_WRITE, PORT_WRITE + PORT_READ
    assert desk.log == [(0, None), (first, 0), (second, None), (second + PORT_WRITE, 1)]
    assert desk.engine.pins == []
    assert desk.pins_told == [("LINE", 1), ("LINE", 0)]


@pytest.mark.parametrize("other_us", [0, 1, 99, 100, 101, 104, 105, 106])
def test_other_events_do_not_move_the_poll(desk_of, other_us):
    """They happen at their own time, before, while and after the pin gets its level."""
    desk = desk_of(script(awaiting()))
    desk.ack_at(100)
    happened = []
    desk.at(other_us, lambda: happened.append(desk.us))
    assert desk.run().log == [(105, True)]
    assert happened == [other_us]


def test_level_removed_before_the_poll_is_not_seen(desk_of):
    """A supply that is cut when ACK rises: the program sees no ACK before the next one."""
    desk = desk_of(script(awaiting()))
    desk.ack_at(100)
    desk.at(100, lambda: desk.ack_at(200))
    assert desk.run().log == [(203, True)]


def test_engine_stops_at_events_and_looks_ahead_a_limited_time(desk_of):
    """A host that writes in between is late for the FPGA by no more than that."""
    desk = desk_of(script(awaiting(timeout_us=200_000)))
    events = [10, 777, 778, 4999]
    for us in events:
        desk.at(us, lambda: None)
    bursts = desk.run().engine.bursts
    for us in events:
        time = (us + BOOT_US) * PS_PER_US
        assert not [burst for burst in bursts if burst[0] < time < burst[1]]
    assert max(end - start for start, end in bursts) == LOOK_AHEAD_PS


@pytest.mark.parametrize("answer", [b"\x12", None])
def test_camera_transfer_takes_the_time_of_the_bus_and_the_engine_follows(desk_of, answer):
    request, performed = req.CameraTransfer(b"\x81\x00", read=1), []

    def transfer(*told):
        performed.append((*told, desk.engine.now_ps))
        return answer

    desk = desk_of(script(5, request))
    desk.camera_bus.transfer = transfer
    assert desk.run().log == [(155, answer)]
    assert performed == [(request, *[(BOOT_US + 155) * PS_PER_US] * 2)]


def test_reset_restarts_the_program_with_its_cause_and_forgets_wakes(desk_of):
    closed = []

    def first(desk):
        desk.processor.wake()
        desk.work(10)
        try:
            yield req.Reset(5)
        finally:
            closed.append(desk.us)

    desk = desk_of(first, script(PAY, sleep(500)))
    before = desk.processor.program
    assert desk.processor.resets == 0
    assert desk.run().log == [(10 + BOOT_US, None), (500, False)]
    assert (closed, desk.causes, desk.processor.resets) == ([10], [POWER_ON, 5], 1)
    assert desk.processor.program is not before


def test_forced_reset_stops_the_program_wherever_it_is(desk_of):
    """Once asleep, once at work, once while it boots; what was charged is never paid."""
    desk = desk_of(script(sleep(5_000)), script(9_000, PAY), script(), script(PAY, sleep(900)))
    told = []
    desk.processor.on_forced_reset = lambda: told.append(desk.us)
    for us, cause in ((40, 6), (200, 7), (250, 8)):
        desk.at(us, lambda cause=cause: desk.processor.reset(cause))
    assert desk.run().log == [(250 + BOOT_US, None), (900, False)]
    assert (desk.causes, told) == ([POWER_ON, 6, 7, 8], [40, 200, 250])
    assert (40, True) in desk.activity  # it woke


def test_hanging_program_serves_interrupts_until_it_is_reset(desk_of):
    desk = desk_of(script(sleep(5_000)), script(PAY))
    desk.at(10, lambda: desk.processor.reset(5, hang_us=1_000))
    served = []
    desk.at(500, lambda: served.append(len(desk.causes)))
    assert desk.run().log == [(1_010 + BOOT_US, None)]
    assert (served, desk.causes) == ([1], [POWER_ON, 5])


@pytest.mark.parametrize(
    ("step", "text"),
    [
        ("please", r"\.py:\d+: a program must yield a request, not 'please'"),
        (req.Sleep(None, wakeable=False), "give a deadline or make it wakeable"),
    ],
)
def test_rejects_invalid_requests(desk_of, step, text):
    with pytest.raises(RequestError, match=text):
        desk_of(script(step)).run()


@pytest.mark.parametrize(
    "request_",
    [req.SetPin("ENABLE", 1), READ_ACK, awaiting(), req.StrobeRead(np.zeros(1, np.uint8), 4)],
)
def test_a_board_without_an_fpga_refuses_what_needs_one(desk_of, request_):
    desk = desk_of(script(req.CameraTransfer(b""), req.SetPin("LINE", 1), request_))
    desk.processor.fpga = None
    with pytest.raises(ValueError, match="this board has no FPGA"):
        desk.run()
    assert desk.pins_told == [("LINE", 1)]


def test_program_that_returns_without_reset_raises_runtime_error(desk_of):
    desk = desk_of()
    desk.processor.program.main = lambda: (request for request in [PAY])
    with pytest.raises(RuntimeError, match="must end in Reset"):
        desk.run()


def test_reports_wake_at_the_deadline_once(desk_of):
    desk = desk_of(script(sleep(500), sleep(900)))
    desk.at(500, desk.processor.wake)
    assert sorted(answer for _, answer in desk.run().log) == [False, True]


def test_processor_reports_its_activity(desk_of):
    desk = desk_of(script(sleep(500), sleep(900))).run()
    assert desk.activity == [
        (-BOOT_US, True), (0, False), (500, True), (500, False), (900, True), (900, False)
    ]  # fmt: skip


def test_processor_dozes_until_an_interrupt_and_waits_without_a_deadline(desk_of):
    desk = desk_of(script(sleep(500, wakeable=False), sleep(900), req.Sleep(None)))
    for us, waiting, dozing in ((499, False, False), (899, False, True), (1999, True, True)):
        processor = desk.run(us).processor
        assert (processor.waiting, processor.dozing) == (waiting, dozing)
    assert len(desk.log) == 2
    desk.at(2000, desk.processor.wake)
    assert desk.run().log[2:] == [(2000, True)]


CYCLES = 38
HZ = 48_000_000  # 38 cycles are 791 666 2/3 ps


def exact_ps(cycles: int) -> int:
    return cycles * PS_PER_S // HZ


def transfer(count: int, work: int = 0):
    """Notes how many ps a transfer takes, and what it brings."""

    def body(desk):
        out, start = np.zeros(count, np.uint8), desk.kernel.now
        desk.work(work)
        yield req.StrobeRead(out, CYCLES)
        desk.note((desk.kernel.now - start, out.tolist()))

    return body


@pytest.mark.parametrize(
    ("count", "events_ps"),
    [
        (0, []),
        (1000, []),
        (1000, [PS_PER_US]),
        (1000, [us * PS_PER_US for us in (5, 6, 7)]),
        (1000, range(PS_PER_US, 200 * PS_PER_US, 3 * PS_PER_US)),
        # Every half turn something happens: the loop still makes one turn at a time.
        (50, range(0, 120 * exact_ps(CYCLES // 2), exact_ps(CYCLES // 2))),
    ],
)
def test_transfer_time_does_not_depend_on_other_events(desk_of, count, events_ps):
    desk = desk_of(transfer(count), hz=HZ)
    for time_ps in events_ps:
        desk.kernel.timeout(BOOT_US * PS_PER_US + time_ps)
    expected = (exact_ps(count * CYCLES), [i % 256 for i in range(count)])
    assert [found for _, found in desk.run(10_000).log] == [expected]


@pytest.mark.parametrize(("work", "interrupts_us"), [(481, []), (0, [10, 11, 300])])
def test_charged_and_interrupt_cycles_extend_a_transfer(desk_of, work, interrupts_us):
    """Where an interrupt breaks the loop, a fraction of a picosecond is lost."""
    desk = desk_of(transfer(1000, work), hz=HZ)
    for us in interrupts_us:
        desk.at(us, lambda: desk.work(80))
    ((_, (took_ps, _)),) = desk.run(10_000).log
    exact = exact_ps(work + 1000 * CYCLES + 80 * len(interrupts_us))
    assert took_ps == pytest.approx(exact, abs=1 + 3 * len(interrupts_us))
