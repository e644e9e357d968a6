"""The processor: tiny programs on a fake FPGA, every duration counted by hand.

The clock is 1 MHz, so a cycle is a microsecond; the test of the transfer loop takes another one,
in which a cycle is no whole number of picoseconds.
"""

from collections.abc import Callable, Generator
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.processor import LOOK_AHEAD_PS, Processor
from cubestack.emulator.virtual_time import PS_PER_S, PS_PER_US, Kernel
from cubestack.firmware_model.costs import Cost, CostTable, Meter
from cubestack.firmware_model.hardware import (
    AwaitPin,
    CameraTransfer,
    Pay,
    ReadTimer,
    Reset,
    SetPin,
    Sleep,
    StrobeRead,
)

BOOT_US = 100
PORT_WRITE = 2
POWER_ON = 1
Body = Callable[["Desk"], Generator[Any, Any, None]]


class FakeEngine:
    """An FPGA whose ACK follows a list of (time, level), and whose DATA counts up.

    Like a real engine it refuses to run back, and drops cycles of the transfer loop that do not
    end in time.
    """

    def __init__(self) -> None:
        self.now_ps = 0
        self.ack: list[tuple[int, int]] = []
        self.pins: list[tuple[int, str, int]] = []
        self.bursts: list[tuple[int, int]] = []
        self._bytes_read = 0
        self._carry: tuple[int, Fraction] | None = None

    def _ack_at(self, time_ps: int) -> int:
        return ([0] + [level for time, level in self.ack if time <= time_ps])[-1]

    def run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        assert until_ps >= self.now_ps, "the engine can not run back"
        start, end = self.now_ps, until_ps
        if stop_on is not None:
            times = [start] + [time for time, _ in self.ack if start < time <= until_ps]
            end = next((time for time in times if self._ack_at(time) == stop_on[1]), until_ps)
        self.now_ps = end
        self.bursts.append((start, end))
        return end

    def set_pin(self, name: str, value: int) -> None:
        self.pins.append((self.now_ps, name, value))

    def get_pin(self, name: str) -> int:
        assert name == "ACK"
        return self._ack_at(self.now_ps)

    def strobe_read(self, out: Any, period: Fraction, until_ps: int) -> int:
        carry = Fraction(0)
        if self._carry is not None and self._carry[0] == self.now_ps:
            carry = self._carry[1]
        start, count = self.now_ps, 0
        while count < len(out) and start + int(carry + (count + 1) * period) <= until_ps:
            out[count] = self._bytes_read % 256
            self._bytes_read += 1
            count += 1
        whole, carry = divmod(carry + count * period, 1)
        self.now_ps = start + whole
        self._carry = (self.now_ps, carry)
        return count


class FakeCameraBus:
    """A camera that takes 50 us for a byte and answers with its own text."""

    def __init__(self) -> None:
        self.answer: bytes | None = b"ok"
        self.performed: list[tuple[int, CameraTransfer]] = []

    def transfer_ps(self, request: CameraTransfer) -> int:
        return (len(request.data) + request.read) * 50 * PS_PER_US

    def transfer(self, request: CameraTransfer, now_ps: int) -> bytes | None:
        self.performed.append((now_ps, request))
        return self.answer


class Program:
    """Runs the body it was given; the program of a later start sleeps for ever."""

    def __init__(self, desk: "Desk", body: Body) -> None:
        self._desk = desk
        self._body = body

    def main(self) -> Generator[Any, Any, None]:
        yield from self._body(self._desk)
        yield Sleep(None)


class Desk:
    """A processor, ready to run the bodies given: one a start, then one that sleeps."""

    def __init__(self, *bodies: Body, hz: int = 1_000_000) -> None:
        costs = {"work": Cost(1, "assumed", "a test"), "port_write": Cost(2, "assumed", "a test")}
        self.kernel = Kernel()
        self.meter = Meter(CostTable("test", hz, costs))
        self.engine = FakeEngine()
        self.camera_bus = FakeCameraBus()
        self.causes: list[int] = []
        self.log: list[tuple[int, Any]] = []
        self.activity: list[tuple[int, bool]] = []
        self.pins_told: list[tuple[str, int]] = []
        self._bodies = list(bodies)
        self.processor = Processor(
            self.kernel,
            self.meter,
            self.engine,  # type: ignore[arg-type]
            self.camera_bus,
            self._boot,
            power_on_cause=POWER_ON,
            boot_us=BOOT_US,
            on_pin=lambda pin, level: self.pins_told.append((pin, level)),
            on_activity=lambda busy: self.activity.append((self.us, busy)),
        )

    @property
    def us(self) -> int:
        """Time since the first start of main, in us."""
        return self.kernel.now // PS_PER_US - BOOT_US

    def _boot(self, cause: int) -> Program:
        self.causes.append(cause)
        return Program(self, self._bodies.pop(0) if self._bodies else lambda _desk: iter(()))

    def work(self, cycles: int) -> None:
        self.meter.charge(work=cycles)

    def note(self, what: object = None) -> None:
        self.log.append((self.us, what))

    def at(self, us: int, action: Callable[[], object]) -> None:
        """Let ``action`` happen ``us`` after the first start of main."""
        delay = (us + BOOT_US) * PS_PER_US - self.kernel.now
        self.kernel.timeout(delay).callbacks.append(lambda _event: action())

    def ack_at(self, *us: int) -> None:
        """ACK rises and falls at these times."""
        times = [(time + BOOT_US) * PS_PER_US for time in us]
        self.engine.ack = [(time, 1 - index % 2) for index, time in enumerate(times)]

    def run(self, us: int = 1_000_000) -> "Desk":
        self.kernel.advance_to((us + BOOT_US) * PS_PER_US)
        return self


# --- cycles ------------------------------------------------------------------------------------


def test_main_starts_after_the_boot_time():
    def body(desk):
        desk.note("main")
        yield Pay()

    desk = Desk(body)
    desk.kernel.advance_to(BOOT_US * PS_PER_US - 1)
    assert not desk.log
    assert desk.run().log == [(0, "main")]
    assert desk.causes == [POWER_ON]


def test_charged_cycles_take_their_time_before_the_next_request():
    def body(desk):
        desk.work(7)
        desk.note()
        yield Pay()
        desk.note()
        desk.work(5)
        desk.note((yield ReadTimer()))

    assert Desk(body).run().log == [(0, None), (7, None), (12, BOOT_US + 12)]


def test_no_cycles_take_no_time():
    def body(desk):
        yield Pay()
        desk.note()

    assert Desk(body).run().log == [(0, None)]


def test_interrupts_extend_the_running_work():
    """One comes during the work, a second one during what the first one added."""

    def body(desk):
        desk.work(100)
        yield Pay()
        desk.note()

    desk = Desk(body)
    desk.at(60, lambda: desk.work(20))
    desk.at(110, lambda: desk.work(3))
    desk.at(124, lambda: desk.work(1000))  # too late: the work is done
    assert desk.run().log == [(123, None)]


# --- pins --------------------------------------------------------------------------------------


def test_pin_is_driven_when_the_work_before_it_is_done():
    def body(desk):
        desk.work(10)
        yield SetPin("ENABLE", 1)
        desk.note()
        yield SetPin("RNW", 1)

    desk = Desk(body).run()
    rises = [((time // PS_PER_US) - BOOT_US, pin, level) for time, pin, level in desk.engine.pins]
    assert rises == [(10, "ENABLE", 1), (10 + PORT_WRITE, "RNW", 1)]
    assert desk.pins_told == [("ENABLE", 1), ("RNW", 1)]
    assert desk.log == [(10, None)]


POLL = 7


def awaiting(level: int = 1, timeout_us: int = 500_000) -> Body:
    def body(desk):
        desk.note((yield AwaitPin("ACK", level, timeout_us, POLL)))

    return body


@pytest.mark.parametrize(
    ("ack_us", "goes_on_us"),
    [(1, 7), (6, 7), (7, 7), (8, 14), (700, 700), (701, 707), (386_002, 386_008)],
)
def test_program_goes_on_at_the_end_of_the_poll_that_sees_the_pin(ack_us, goes_on_us):
    desk = Desk(awaiting())
    desk.ack_at(ack_us)
    assert desk.run().log == [(goes_on_us, True)]


def test_pin_that_is_there_already_costs_one_poll():
    assert Desk(awaiting(level=0)).run().log == [(POLL, True)]


def test_pin_that_never_comes_times_out():
    desk = Desk(awaiting(timeout_us=12_345))
    assert desk.run().log == [(12_345, False)]


@pytest.mark.parametrize(("timeout_us", "seen"), [(100, True), (99, False)])
def test_pin_at_the_timeout(timeout_us, seen):
    desk = Desk(awaiting(timeout_us=timeout_us))
    desk.ack_at(100)
    desk.run()
    assert [answer for _, answer in desk.log] == [seen]


@pytest.mark.parametrize("other_us", [0, 1, 99, 100, 101, 104, 105, 106])
def test_other_events_do_not_move_the_poll(other_us):
    """They happen at their own time, before, while and after the pin gets its level."""
    desk = Desk(awaiting())
    desk.ack_at(100)
    happened = []
    desk.at(other_us, lambda: happened.append(desk.us))
    desk.run()
    assert happened == [other_us]
    assert desk.log == [(105, True)]


def test_event_may_take_the_level_away():
    """A supply that is cut when ACK rises: the program sees no ACK before the next one."""
    desk = Desk(awaiting())
    desk.ack_at(100)
    desk.at(100, lambda: desk.ack_at(200))
    assert desk.run().log == [(203, True)]


def test_engine_never_runs_past_an_event():
    desk = Desk(awaiting())
    desk.ack_at(5000)
    events = [10, 777, 778, 4999]
    for us in events:
        desk.at(us, lambda: None)
    desk.run()
    for us in events:
        time = (us + BOOT_US) * PS_PER_US
        assert not [burst for burst in desk.engine.bursts if burst[0] < time < burst[1]]


def test_look_ahead_is_bounded():
    """So that a host that writes in between is late for the FPGA by no more than that."""
    desk = Desk(awaiting(timeout_us=200_000)).run()
    longest = max(end - start for start, end in desk.engine.bursts)
    assert longest == LOOK_AHEAD_PS


def test_interrupts_during_a_poll_are_paid_afterwards():
    def body(desk):
        yield AwaitPin("ACK", 1, 1000, POLL)
        desk.note()
        yield Pay()
        desk.note()

    desk = Desk(body)
    desk.ack_at(70)
    desk.at(30, lambda: desk.work(25))
    assert desk.run().log == [(70, None), (95, None)]


# --- sleep -------------------------------------------------------------------------------------


def sleeping(deadline_us: int | None, *, wakeable: bool = True, then: int = 0) -> Body:
    def body(desk):
        deadline = None if deadline_us is None else deadline_us + BOOT_US
        desk.note((yield Sleep(deadline, wakeable)))
        if then:
            desk.note((yield Sleep(then + BOOT_US)))

    return body


def test_sleep_ends_at_its_deadline():
    assert Desk(sleeping(500)).run().log == [(500, False)]


def test_wake_ends_a_sleep():
    desk = Desk(sleeping(500))
    desk.at(200, desk.processor.wake)
    assert desk.run().log == [(200, True)]


def test_sleep_without_deadline_waits_for_a_wake():
    desk = Desk(sleeping(None))
    desk.run(1000)
    assert not desk.log
    assert desk.processor.waiting
    desk.at(2000, desk.processor.wake)
    assert desk.run().log == [(2000, True)]


def test_sleep_that_is_not_wakeable_goes_on_and_the_wake_is_kept():
    desk = Desk(sleeping(500, wakeable=False, then=900))
    desk.at(200, desk.processor.wake)
    assert desk.run().log == [(500, False), (500, True)]


def test_wake_before_the_sleep_is_not_lost():
    desk = Desk(sleeping(500, then=900))
    desk.processor.wake()
    assert desk.run().log == [(0, True), (900, False)]


def test_two_wakes_end_one_sleep():
    desk = Desk(sleeping(500, then=900))
    desk.at(100, desk.processor.wake)
    desk.at(100, desk.processor.wake)
    assert desk.run().log == [(100, True), (900, False)]


def test_wake_survives_a_sleep_whose_deadline_has_passed():
    desk = Desk(sleeping(0, then=900))
    desk.processor.wake()
    assert desk.run().log == [(0, False), (0, True)]


def test_wake_at_the_deadline_is_told_once():
    desk = Desk(sleeping(500, then=900))
    desk.at(500, desk.processor.wake)
    desk.run()
    assert sorted(answer for _, answer in desk.log) == [False, True]


def test_sleep_that_nothing_can_end():
    with pytest.raises(ValueError, match="give a deadline or make it wakeable"):
        Desk(sleeping(None, wakeable=False)).run()


def test_activity_is_told():
    desk = Desk(sleeping(500, then=900)).run()
    assert desk.activity == [
        (-BOOT_US, True), (0, False), (500, True), (500, False), (900, True), (900, False)
    ]  # fmt: skip


def test_waiting_means_a_sleep_without_deadline():
    desk = Desk(sleeping(500))
    assert not desk.processor.waiting
    desk.run(499)
    assert not desk.processor.waiting
    desk.run(501)
    assert desk.processor.waiting


def test_interrupts_during_a_sleep_are_paid_afterwards():
    def body(desk):
        yield Sleep(500 + BOOT_US)
        yield Pay()
        desk.note()

    desk = Desk(body)
    desk.at(200, lambda: desk.work(30))
    assert desk.run().log == [(530, None)]


# --- transfer loop -----------------------------------------------------------------------------

CYCLES = 38
HZ = 48_000_000  # 38 cycles are 791 666 2/3 ps


def transfer(count: int, target: list[Any]) -> Body:
    def body(desk):
        out = np.zeros(count, np.uint8)
        target.append(out)
        start = desk.kernel.now
        yield StrobeRead(out, CYCLES)
        desk.note(desk.kernel.now - start)

    return body


def exact_ps(cycles: int) -> int:
    return cycles * PS_PER_S // HZ


@pytest.mark.parametrize("interruptions", [[], [1], [5, 6, 7], list(range(1, 200, 3))])
def test_transfer_takes_its_cycles_whatever_happens_in_between(interruptions):
    target = []
    desk = Desk(transfer(1000, target), hz=HZ)
    for us in interruptions:
        desk.at(us, lambda: None)
    desk.run(10_000)
    assert desk.log[0][1] == exact_ps(1000 * CYCLES)
    assert np.array_equal(target[0], np.arange(1000) % 256)


def test_interrupts_steal_cycles_from_a_transfer():
    desk = Desk(transfer(1000, []), hz=HZ)
    for us in (10, 11, 300):
        desk.at(us, lambda: desk.work(80))
    desk.run(10_000)
    # Where an interrupt breaks the loop, a fraction of a picosecond is lost.
    assert desk.log[0][1] == pytest.approx(exact_ps(1000 * CYCLES + 3 * 80), abs=8)


def test_events_shorter_than_a_loop_turn_do_not_stop_it():
    """Every half turn something happens: the loop still makes one turn at a time."""
    desk = Desk(transfer(50, []), hz=HZ)
    step = exact_ps(CYCLES // 2)
    for index in range(120):
        desk.kernel.timeout(BOOT_US * PS_PER_US + index * step)
    desk.run(10_000)
    assert desk.log[0][1] == exact_ps(50 * CYCLES)


def test_work_before_a_transfer_is_done_before_it():
    def body(desk):
        desk.work(481)
        yield StrobeRead(np.zeros(10, np.uint8), CYCLES)
        desk.note(desk.kernel.now - BOOT_US * PS_PER_US)

    desk = Desk(body, hz=HZ).run(10_000)
    assert desk.log[0][1] == pytest.approx(exact_ps(481 + 10 * CYCLES), abs=1)


def test_empty_transfer():
    desk = Desk(transfer(0, []), hz=HZ).run(10_000)
    assert desk.log == [(0, 0)]


# --- camera bus, reset, mistakes ---------------------------------------------------------------


@pytest.mark.parametrize("answer", [b"\x12", None])
def test_camera_transfer_takes_the_time_of_the_bus(answer):
    request = CameraTransfer(b"\x81\x00", read=1)

    def body(desk):
        desk.work(5)
        desk.note((yield request))

    desk = Desk(body)
    desk.camera_bus.answer = answer
    desk.run()
    assert desk.log == [(155, answer)]
    assert desk.camera_bus.performed == [((BOOT_US + 155) * PS_PER_US, request)]


def test_engine_is_up_to_date_when_the_camera_is_told():
    times = []

    def body(desk):
        yield CameraTransfer(b"\x81\x00")

    desk = Desk(body)
    desk.camera_bus.transfer = lambda _request, _now: times.append(desk.engine.now_ps)
    desk.run()
    assert times == [(BOOT_US + 100) * PS_PER_US]


def test_reset_starts_anew_with_its_cause():
    def first(desk):
        desk.work(10)
        yield Reset(5)
        desk.note("never")

    def second(desk):
        desk.note("second")
        yield Pay()

    desk = Desk(first, second)
    assert desk.processor.resets == 0
    desk.run()
    assert desk.causes == [POWER_ON, 5]
    assert desk.processor.resets == 1
    assert desk.log == [(10 + BOOT_US, "second")]


def test_reset_closes_the_program():
    closed = []

    def first(_desk):
        try:
            yield Reset(5)
        finally:
            closed.append(True)

    Desk(first).run()
    assert closed == [True]


def test_reset_forgets_a_pending_wake():
    def first(desk):
        desk.processor.wake()
        yield Reset(5)

    desk = Desk(first, sleeping(500)).run()
    assert desk.log == [(500, False)]


def test_interrupts_reach_the_program_that_runs_now():
    def first(_desk):
        yield Reset(5)

    desk = Desk(first, sleeping(None))
    before = desk.processor.program
    desk.run(1000)
    assert desk.processor.program is not before


def test_unknown_request():
    def body(_desk):
        yield "please"

    with pytest.raises(TypeError, match="a program can not request 'please'"):
        Desk(body).run()


def test_program_that_returns():
    desk = Desk(lambda _desk: iter(()))
    desk.processor.program.main = lambda: (request for request in [Pay()])
    with pytest.raises(RuntimeError, match="must end in Reset"):
        desk.run()
