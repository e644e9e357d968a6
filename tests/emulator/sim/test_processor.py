"""The processor's requests: every duration counted by hand, a cycle is a microsecond."""

import numpy as np
import pytest

from cubestack.emulator.sim.processor import LOOK_AHEAD_PS
from cubestack.emulator.sim.virtual_time import PS_PER_US
from cubestack.firmware_model.mcu.requests import (
    AwaitPin,
    CameraTransfer,
    Pay,
    ReadPin,
    ReadTimer,
    Reset,
    SetPin,
    Sleep,
    StrobeRead,
)

BOOT_US = 100
PORT_WRITE = 2
PORT_READ = 3
POWER_ON = 1


def test_a_board_without_an_fpga_refuses_what_needs_one(desk_of):
    for request in (
        SetPin("ENABLE", 1),
        ReadPin("ACK"),
        AwaitPin("ACK", 1, 10, poll_cycles=1),
        StrobeRead(np.zeros(1, np.uint8), 4),
    ):

        def body(desk, request=request):
            yield CameraTransfer(b"")
            yield SetPin("LINE", 1)
            yield request

        desk = desk_of(body)
        desk.processor.fpga = None
        with pytest.raises(ValueError, match="this board has no FPGA"):
            desk.run()
        assert desk.pins_told == [("LINE", 1)]


# --- cycles ------------------------------------------------------------------------------------


def test_main_starts_after_the_boot_time(desk_of):
    def body(desk):
        desk.note("main")
        yield Pay()

    desk = desk_of(body)
    desk.kernel.advance_to(BOOT_US * PS_PER_US - 1)
    assert not desk.log
    assert desk.run().log == [(0, "main")]
    assert desk.causes == [POWER_ON]


def test_charged_cycles_take_their_time_before_the_next_request(desk_of):
    def body(desk):
        desk.work(7)
        desk.note()
        yield Pay()
        desk.note()
        desk.work(5)
        desk.note((yield ReadTimer()))

    assert desk_of(body).run().log == [(0, None), (7, None), (12, BOOT_US + 12)]


def test_no_cycles_take_no_time(desk_of):
    def body(desk):
        yield Pay()
        desk.note()

    assert desk_of(body).run().log == [(0, None)]


def test_interrupts_extend_the_running_work(desk_of):
    """One comes during the work, a second one during what the first one added."""

    def body(desk):
        desk.work(100)
        yield Pay()
        desk.note()

    desk = desk_of(body)
    desk.at(60, lambda: desk.work(20))
    desk.at(110, lambda: desk.work(3))
    desk.at(124, lambda: desk.work(1000))  # too late: the work is done
    assert desk.run().log == [(123, None)]


# --- pins --------------------------------------------------------------------------------------


def test_pin_is_driven_when_the_work_before_it_is_done(desk_of):
    def body(desk):
        desk.work(10)
        yield SetPin("ENABLE", 1)
        desk.note()
        yield SetPin("RNW", 1)

    desk = desk_of(body).run()
    rises = [((time // PS_PER_US) - BOOT_US, pin, level) for time, pin, level in desk.engine.pins]
    assert rises == [(10, "ENABLE", 1), (10 + PORT_WRITE, "RNW", 1)]
    assert desk.pins_told == [("ENABLE", 1), ("RNW", 1)]
    assert desk.log == [(10, None)]


def test_pin_that_does_not_lead_to_the_fpga(desk_of):
    def body(desk):
        yield SetPin("LINE", 1)
        desk.note((yield ReadPin("LINE")))
        yield SetPin("LINE", 0)
        desk.note((yield ReadPin("LINE")))

    desk = desk_of(body).run()
    first = PORT_WRITE
    assert desk.log == [(first, 0), (first + PORT_READ + PORT_WRITE, 1)]
    assert desk.engine.pins == []
    assert desk.pins_told == [("LINE", 1), ("LINE", 0)]


def test_pin_of_the_fpga_is_read_when_the_work_before_it_is_done(desk_of):
    def body(desk):
        desk.note((yield ReadPin("ACK")))
        desk.work(10)
        desk.note((yield ReadPin("ACK")))

    desk = desk_of(body)
    desk.ack_at(5)
    assert desk.run().log == [(0, 0), (PORT_READ + 10, 1)]


POLL = 7


def awaiting(level: int = 1, timeout_us: int = 500_000):
    def body(desk):
        desk.note((yield AwaitPin("ACK", level, timeout_us, POLL)))

    return body


@pytest.mark.parametrize(
    ("ack_us", "goes_on_us"),
    [(1, 7), (6, 7), (7, 7), (8, 14), (700, 700), (701, 707), (386_002, 386_008)],
)
def test_program_goes_on_at_the_end_of_the_poll_that_sees_the_pin(desk_of, ack_us, goes_on_us):
    desk = desk_of(awaiting())
    desk.ack_at(ack_us)
    assert desk.run().log == [(goes_on_us, True)]


def test_pin_that_is_there_already_costs_one_poll(desk_of):
    assert desk_of(awaiting(level=0)).run().log == [(POLL, True)]


def test_pin_that_never_comes_times_out(desk_of):
    desk = desk_of(awaiting(timeout_us=12_345))
    assert desk.run().log == [(12_345, False)]


@pytest.mark.parametrize(("timeout_us", "seen"), [(100, True), (99, False)])
def test_pin_at_the_timeout(desk_of, timeout_us, seen):
    desk = desk_of(awaiting(timeout_us=timeout_us))
    desk.ack_at(100)
    desk.run()
    assert [answer for _, answer in desk.log] == [seen]


@pytest.mark.parametrize("other_us", [0, 1, 99, 100, 101, 104, 105, 106])
def test_other_events_do_not_move_the_poll(desk_of, other_us):
    """They happen at their own time, before, while and after the pin gets its level."""
    desk = desk_of(awaiting())
    desk.ack_at(100)
    happened = []
    desk.at(other_us, lambda: happened.append(desk.us))
    desk.run()
    assert happened == [other_us]
    assert desk.log == [(105, True)]


def test_event_may_take_the_level_away(desk_of):
    """A supply that is cut when ACK rises: the program sees no ACK before the next one."""
    desk = desk_of(awaiting())
    desk.ack_at(100)
    desk.at(100, lambda: desk.ack_at(200))
    assert desk.run().log == [(203, True)]


def test_engine_never_runs_past_an_event(desk_of):
    desk = desk_of(awaiting())
    desk.ack_at(5000)
    events = [10, 777, 778, 4999]
    for us in events:
        desk.at(us, lambda: None)
    desk.run()
    for us in events:
        time = (us + BOOT_US) * PS_PER_US
        assert not [burst for burst in desk.engine.bursts if burst[0] < time < burst[1]]


def test_look_ahead_is_bounded(desk_of):
    """So that a host that writes in between is late for the FPGA by no more than that."""
    desk = desk_of(awaiting(timeout_us=200_000)).run()
    longest = max(end - start for start, end in desk.engine.bursts)
    assert longest == LOOK_AHEAD_PS


def test_interrupts_during_a_poll_are_paid_afterwards(desk_of):
    def body(desk):
        yield AwaitPin("ACK", 1, 1000, POLL)
        desk.note()
        yield Pay()
        desk.note()

    desk = desk_of(body)
    desk.ack_at(70)
    desk.at(30, lambda: desk.work(25))
    assert desk.run().log == [(70, None), (95, None)]


# --- camera bus, reset, mistakes ---------------------------------------------------------------


@pytest.mark.parametrize("answer", [b"\x12", None])
def test_camera_transfer_takes_the_time_of_the_bus(desk_of, answer):
    request = CameraTransfer(b"\x81\x00", read=1)

    def body(desk):
        desk.work(5)
        desk.note((yield request))

    desk = desk_of(body)
    desk.camera_bus.answer = answer
    desk.run()
    assert desk.log == [(155, answer)]
    assert desk.camera_bus.performed == [((BOOT_US + 155) * PS_PER_US, request)]


def test_engine_is_up_to_date_when_the_camera_is_told(desk_of):
    times = []

    def body(desk):
        yield CameraTransfer(b"\x81\x00")

    desk = desk_of(body)
    desk.camera_bus.transfer = lambda _request, _now: times.append(desk.engine.now_ps)
    desk.run()
    assert times == [(BOOT_US + 100) * PS_PER_US]


def test_reset_starts_anew_with_its_cause(desk_of):
    def first(desk):
        desk.work(10)
        yield Reset(5)
        desk.note("never")

    def second(desk):
        desk.note("second")
        yield Pay()

    desk = desk_of(first, second)
    assert desk.processor.resets == 0
    desk.run()
    assert desk.causes == [POWER_ON, 5]
    assert desk.processor.resets == 1
    assert desk.log == [(10 + BOOT_US, "second")]


def test_reset_closes_the_program(desk_of):
    closed = []

    def first(_desk):
        try:
            yield Reset(5)
        finally:
            closed.append(True)

    desk_of(first).run()
    assert closed == [True]


def test_reset_forgets_a_pending_wake(desk_of):
    def first(desk):
        desk.processor.wake()
        yield Reset(5)

    def second(desk):
        desk.note((yield Sleep(500 + BOOT_US)))

    desk = desk_of(first, second).run()
    assert desk.log == [(500, False)]


def test_interrupts_reach_the_program_that_runs_now(desk_of):
    def first(_desk):
        yield Reset(5)

    desk = desk_of(first)
    before = desk.processor.program
    desk.run(1000)
    assert desk.processor.program is not before


def test_unknown_request(desk_of):
    def body(_desk):
        yield "please"

    with pytest.raises(TypeError, match="a program can not request 'please'"):
        desk_of(body).run()


def test_program_that_returns(desk_of):
    desk = desk_of(lambda _desk: iter(()))
    desk.processor.program.main = lambda: (request for request in [Pay()])
    with pytest.raises(RuntimeError, match="must end in Reset"):
        desk.run()
