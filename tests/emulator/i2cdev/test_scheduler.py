"""I2cScheduler with programs, in a made-up wall time: when their answers come."""

import heapq
import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.emulator.bus.i2c import I2cBus, I2cMessage
from cubestack.emulator.i2cdev import scheduler as module
from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.scheduler import TURNAROUND_NS, I2cScheduler
from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.emulator.ports.pace import Pace
from cubestack.emulator.ports.realtime import RealtimeScheduler
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

from .conftest import Registers

US = 1000
BIT_NS = 2500
READ_BITS = (1 + 9 + 9) + (1 + 9 + 9) + 1
READ_NS = READ_BITS * BIT_NS  #: A register's byte at 400 kHz

POINTER = I2cMessage(0x1A, bytearray(1))
WAY_NS = 15 * US  #: From a program to the emulation, or back


class World:
    """Wall time, which passes a bit at each look at the clock, and what happens in it."""

    def __init__(self) -> None:
        self.now_ns = 12_345_678  #: wall time
        #: stalls: time that goes by, all at once, at the next look at the clock after a time
        self.stalls: list[tuple[int, int]] = []
        self._arrivals: list[tuple[int, int, Callable[[], None]]] = []
        self._order = itertools.count()

    def monotonic_ns(self) -> int:
        self.now_ns += 100
        if self.stalls and self.now_ns >= self.stalls[0][0]:
            self.now_ns += self.stalls.pop(0)[1]
        return self.now_ns

    def arrive(self, time_ns: int, what: Callable[[], None]) -> None:
        heapq.heappush(self._arrivals, (time_ns, next(self._order), what))

    def take(self) -> None:
        while self._arrivals and self._arrivals[0][0] <= self.now_ns:
            heapq.heappop(self._arrivals)[2]()

    def sleep(self, duration_ns: int) -> bool:
        end_ns = self.now_ns + duration_ns
        if not self._arrivals or self._arrivals[0][0] > end_ns:
            self.now_ns = max(self.now_ns, end_ns)
            return False
        self.now_ns = max(self.now_ns, self._arrivals[0][0])
        return True


@dataclass
class Port(Endpoint):
    world: World

    def exchange(self, now_ps: int) -> None:
        self.world.take()

    def close(self) -> None: ...


@dataclass
class GuestProcess:
    """Calls again and again, as often as it has messages."""

    bench: "ScheduledWorld"
    think_ns: int
    calls: int  #: that are left
    message: Callable[[], list[I2cMessage]]
    #: wall time before and after each call, as the program sees it, in ns
    times: list[tuple[int, int]] = field(default_factory=list)
    ends: list[int] = field(default_factory=list)  #: virtual time of the ends, in ps

    def next(self, now_ns: int) -> None:
        began_ns = now_ns + self.think_ns
        self.bench.world.arrive(began_ns + WAY_NS, partial(self._submit, began_ns))

    def _submit(self, began_ns: int) -> None:
        self.bench.adapter.submit(self.message(), partial(self._done, began_ns))

    def _done(self, began_ns: int, result: int) -> None:
        assert result == 0
        seen_ns = self.bench.world.now_ns + WAY_NS
        self.times.append((began_ns, seen_ns))
        self.ends.append(self.bench.kernel.now)
        self.calls -= 1
        if self.calls:
            self.next(seen_ns)
        else:
            self.bench.running -= 1

    @property
    def durations(self) -> list[int]:
        return [end - start for start, end in self.times]

    @property
    def span(self) -> int:
        return self.times[-1][1] - self.times[0][1]


class ScheduledWorld:
    def __init__(
        self,
        patch: pytest.MonkeyPatch,
        *,
        fast: bool = False,
        busy: Callable[[], bool] = lambda: False,
    ) -> None:
        self.world = World()
        patch.setattr(module, "Watch", AtWork)
        self.kernel = Kernel()
        bus = I2cBus(self.kernel, 10**9 // BIT_NS)
        bus.attach(0x1A, Registers())
        self.adapter = I2cAdapter(self.kernel, bus)
        self.running = 0
        port = Port(self.world)
        self.pace = Pace(self.kernel, "fast" if fast else "real", self.world.monotonic_ns)
        self.calls = I2cScheduler("calls", self.adapter, [port], busy, self.pace)
        self.scheduler = RealtimeScheduler(
            self.kernel,
            [self.calls, port],
            lambda: self.adapter.busy or busy(),
            self.pace,
            wait=self._wait,
        )

    def _wait(self, _watched: object, timeout_s: float) -> None:
        if not self.running:
            self.scheduler.stop()
        self.world.sleep(max(0, int(timeout_s * 1e9) - 150 * US))

    def program(
        self,
        think_ns: int,
        calls: int,
        message: Callable[[], list[I2cMessage]] = lambda: [POINTER, I2cMessage(0x1A, read=1)],
        *,
        wait_ns: int = 0,
    ) -> GuestProcess:
        self.running += 1
        made = GuestProcess(self, think_ns, calls, message)
        made.next(self.world.now_ns + wait_ns)
        return made

    def quick_and_slow(self, think_ns: int, calls: int) -> GuestProcess:
        """A program that shows how long the way of a call is, then another one."""
        self.program(think_ns=0, calls=3)
        return self.program(think_ns, calls, wait_ns=1_000 * US)


class AtWork:
    def __init__(self, ports: list[Port], *, always_asleep: bool) -> None:
        assert not always_asleep
        self._ports = ports
        self._world = ports[0].world

    def wait(self, timeout_ns: int, *, awake: bool = False) -> list[Port]:
        return self._ports if self._world.sleep(timeout_ns) else []

    def nap(self, duration_ns: int) -> None: ...

    def close(self) -> None: ...


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Callable[..., ScheduledWorld]:
    return partial(ScheduledWorld, monkeypatch)


def test_transfers_one_after_the_other_take_the_time_of_the_wire(make):
    bench = make()
    program = bench.program(think_ns=8 * US, calls=201)
    bench.scheduler.run()
    assert program.span / 200 == pytest.approx(READ_NS, rel=0.01)
    assert min(program.durations[1:]) > READ_NS - 8 * US - US


@settings(deadline=None, max_examples=20)
@given(st.lists(st.integers(0, 1000), min_size=1, max_size=5))
def test_transfers_never_finish_before_their_wire_time(think_us):
    """Whatever the programs do, the wire does one thing at a time."""
    with pytest.MonkeyPatch.context() as patch:
        bench = ScheduledWorld(patch)
        programs = [bench.program(think * US, 20) for think in think_us]
        bench.scheduler.run()
    seen = sorted(end for program in programs for _, end in program.times)
    began = min(program.times[0][0] for program in programs)
    for count, end in enumerate(seen, 1):
        assert end - began >= count * READ_NS - 1


@pytest.mark.parametrize("think_us", [TURNAROUND_NS // US, 500, 5_000, 50_000])
def test_infrequent_calls_take_the_transfer_time(make, think_us):
    bench = make()
    program = bench.quick_and_slow(think_ns=think_us * US, calls=20)
    bench.scheduler.run()
    assert program.durations == pytest.approx([READ_NS] * 20, abs=5 * US)


@pytest.mark.parametrize("speed", [0.5, 1.0, 20.0])
def test_calls_keep_their_pace_after_a_jump_of_virtual_time(make, speed):
    """Neither ahead nor at another speed does a program wait for what wall time never gets to."""
    bench = make()

    def send() -> None:
        bench.kernel.advance_to(bench.kernel.now + 100 * PS_PER_S)
        bench.pace.change("real", speed)

    bench.world.arrive(bench.world.now_ns + 1_000 * US, send)
    after = bench.program(think_ns=8 * US, calls=51, wait_ns=2_000 * US)
    bench.scheduler.run()
    assert after.span / 50 == pytest.approx(max(READ_NS / speed, 2 * WAY_NS + 8 * US), rel=0.05)


def test_first_call_takes_the_full_round_trip(make):
    bench = make()
    program = bench.program(think_ns=1_000 * US, calls=1)
    bench.scheduler.run()
    assert program.durations[0] == pytest.approx(READ_NS + 2 * WAY_NS, abs=5 * US)


@pytest.mark.parametrize(
    ("think_us", "when_us"), [*((8, 3_000 + step) for step in range(0, 100, 13)), (500, 3_360)]
)
def test_late_answer_is_compensated(make, think_us, when_us):
    """Soon a program is where it would be."""
    spans = []
    for stalls in ([], [(make().world.now_ns + when_us * US, 150 * US)]):
        bench = make()
        bench.world.stalls = stalls
        program = bench.quick_and_slow(think_ns=think_us * US, calls=101)
        bench.scheduler.run()
        spans.append(program.span)
    assert spans[1] == pytest.approx(spans[0], abs=50 * US)


@pytest.mark.parametrize("when_us", range(1_000, 1_100, 13))
@pytest.mark.parametrize("stall_us", [3_000, 20_000])
def test_time_lost_beyond_the_limit_is_not_recovered(make, when_us, stall_us):
    bench = make()
    bench.world.stalls = [(bench.world.now_ns + when_us * US, stall_us * US)]
    program = bench.program(think_ns=8 * US, calls=101)
    bench.scheduler.run()
    lost_us = (program.span - 100 * READ_NS) / US
    assert stall_us - 1_050 < lost_us < stall_us + 200


@pytest.mark.parametrize("bytes_", [32, 8192])
def test_long_transfers_take_their_wire_time(make, bytes_):
    bench = make()
    program = bench.program(8 * US, 5, lambda: [I2cMessage(0x1A, read=bytes_)])
    bench.scheduler.run()
    wire_ns = (1 + 9 + 9 * bytes_ + 1) * BIT_NS
    assert program.span / 4 == pytest.approx(wire_ns, rel=0.01)


def test_programs_take_turns_on_the_wire(make):
    bench = make()
    programs = [bench.program(think_ns=8 * US, calls=51) for _ in range(3)]
    bench.scheduler.run()
    spans = [program.span / 50 for program in programs]
    assert spans == pytest.approx([3 * READ_NS] * 3, rel=0.05)


def test_fast_pace_counts_wire_time_only(make):
    bench = make(fast=True)
    program = bench.program(think_ns=0, calls=101)
    bench.scheduler.run()
    assert program.span / 100 < READ_NS * 0.7
    assert bench.kernel.now >= 101 * READ_NS * US


def test_at_full_speed_a_busy_device_runs_ahead(make):
    """Programs need not ask again and again until it has done its work."""
    bench = make(fast=True, busy=lambda: bool(program.ends) and bench.kernel.now < 10**11)
    bench.kernel.process(bench.kernel.timeout(10**9) for _ in range(100))
    program = bench.program(think_ns=0, calls=10)
    bench.scheduler.run()
    assert program.ends[0] < 10**10
    assert program.ends[1] > 10**11


@pytest.mark.parametrize(("stall_ns", "done"), [(0, True), (4_000 * US, True), (6_000 * US, False)])
def test_at_full_speed_a_transfer_takes_at_most_one_visit(make, stall_ns, done):
    """A visit may last ``VISIT_NS`` of wall time, 5 ms."""
    bench = make(fast=True)
    program = bench.program(0, 1, lambda: [I2cMessage(0x1A, read=8192)])
    bench.world.now_ns += 1_000 * US
    bench.world.stalls = [(bench.world.now_ns + 50 * US, stall_ns)]
    bench.calls.exchange(bench.kernel.now)
    assert bool(program.ends) is done
    assert bench.adapter.busy is not done
    bench.scheduler.run()
    assert program.ends


def test_nothing_is_served_while_virtual_time_is_held(make):
    bench = make(fast=True)
    program = bench.program(0, 1)
    bench.world.now_ns += 1_000 * US
    bench.kernel.hold("me")
    bench.calls.exchange(bench.kernel.now)
    assert not bench.adapter.busy
    bench.kernel.release("me")
    bench.calls.exchange(bench.kernel.now)
    assert program.ends
