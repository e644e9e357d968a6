"""The scheduler on a wall clock of the test's own: every reading of it costs 10 us."""

import select
import signal
import socket
import threading
from collections.abc import Callable, Generator
from typing import Any

import pytest

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports import realtime
from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.emulator.ports.pace import Pace
from cubestack.emulator.ports.realtime import IDLE_S, SLICE_S, RealtimeScheduler
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S, Kernel

from .conftest import NS_PER_MS, Wall


class FakePort(Endpoint):
    """Records its calls and stops the scheduler at the end."""

    congested = False

    def __init__(self, wall: Wall) -> None:
        self._wall = wall
        self.exchanges: list[int] = []
        self.wall_ms: list[float] = []
        self.releases: list[int] = []
        self.on_exchange: Callable[[], object] = lambda: None

    def exchange(self, now_ps: int) -> None:
        self.exchanges.append(now_ps)
        self.wall_ms.append(self._wall.ms)
        self.releases = [ps for ps in self.releases if ps > now_ps]
        self.on_exchange()

    def release_ps(self, count: int) -> int | None:
        return self.releases[:count][-1] if self.releases else None

    def close(self) -> None:
        pass


class TimedPort:
    def __init__(self) -> None:
        self.kernel = Kernel()
        self.wall = Wall()
        self.port = FakePort(self.wall)
        self.reports: list[tuple[float, str]] = []
        self.busy: Callable[[], bool] = lambda: False

    def run(self, pace: Any, wall_ms: float) -> "TimedPort":
        scheduler = RealtimeScheduler(
            self.kernel,
            [self.port],
            lambda: self.busy(),
            Pace(self.kernel, pace, self.wall.clock),
            report=lambda text: self.reports.append((self.wall.ms, text)),
            wait=self.wall.wait,
        )
        self.port.on_exchange = lambda: scheduler.stop() if self.wall.ms >= wall_ms else None
        scheduler.run()
        return self

    def tick(self, period_ps: int, cost_ns: int = 0, until_ps: int | None = None) -> list[Any]:
        """Start a process that works off one event a period; virtual and wall ms of each."""
        ticks = []

        def process() -> Generator[Any, Any, None]:
            while until_ps is None or self.kernel.now < until_ps:
                yield self.kernel.timeout(period_ps)
                self.wall.ns += cost_ns
                ticks.append((self.kernel.now / PS_PER_MS, self.wall.ms))

        self.kernel.process(process())
        return ticks


@pytest.fixture
def bench() -> TimedPort:
    return TimedPort()


@pytest.mark.parametrize("pace", ["real", "fast"])
def test_idle_scheduler_sleeps(bench, pace):
    bench.run(pace, 10_000)
    assert min(bench.wall.waits) == IDLE_S
    assert len(bench.wall.waits) <= 10 / IDLE_S


def test_virtual_time_follows_wall_time(bench):
    ticks = bench.tick(7 * PS_PER_MS)
    bench.run("real", 5000)
    assert bench.wall.waits[0] == pytest.approx(0.007, abs=0.0002)  # until something is due
    assert len(bench.wall.waits) == pytest.approx(5000 / 7, abs=15)
    assert len(ticks) == pytest.approx(5000 / 7, abs=1)
    assert max(abs(wall - virtual) for virtual, wall in ticks) < 0.2
    assert bench.kernel.now / PS_PER_MS == pytest.approx(5000, abs=IDLE_S * 1000 + 1)


def test_scheduler_sleeps_until_a_byte_is_due(bench):
    bench.port.releases = [3 * PS_PER_MS, 5 * PS_PER_MS]
    bench.run("real", 100)
    assert bench.wall.waits[0] == pytest.approx(0.003, abs=0.0002)
    assert bench.wall.waits[1] == pytest.approx(0.002, abs=0.0002)


def test_virtual_time_continues_from_its_current_value(bench):
    bench.kernel.advance_to(77 * PS_PER_S)
    bench.run("real", 1000)
    assert bench.kernel.now == pytest.approx(78 * PS_PER_S, abs=0.05 * PS_PER_S)


def test_client_bytes_arrive_at_the_time_of_writing(bench):
    """Not at the time when the scheduler went to sleep."""
    bench.wall.during_wait[3] = 11 * NS_PER_MS
    bench.run("real", 200)
    before = 3 * IDLE_S * 1000
    assert bench.port.exchanges[4] / PS_PER_MS == pytest.approx(before + 11, abs=0.5)


def test_reports_lag(bench):
    """A device that costs twice the time it simulates: after 10 s, 5 s are missing."""
    bench.tick(PS_PER_MS, cost_ns=2 * NS_PER_MS)
    bench.run("real", 10_100)
    times = [time for time, _ in bench.reports]
    assert times == [pytest.approx(realtime.LAG_REPORT_S * 1000 * i, abs=20) for i in (1, 2)]
    lags = [float(text.split()[5]) for _, text in bench.reports]
    assert lags == [pytest.approx(2.5, abs=0.1), pytest.approx(5.0, abs=0.1)]
    assert bench.reports[0][1].startswith("can not keep real time: ")
    assert len(bench.port.exchanges) >= 10 / (2 * SLICE_S)  # ports are served meanwhile


def test_recovered_lag_is_not_reported(bench):
    bench.tick(PS_PER_MS, cost_ns=3 * NS_PER_MS, until_ps=2 * PS_PER_S)
    bench.run("real", 20_000)
    assert [text for time, text in bench.reports if time > 6500] == []
    assert bench.kernel.now / PS_PER_MS == pytest.approx(20_000, abs=50)


def test_short_delay_is_not_reported(bench):
    bench.tick(7 * PS_PER_S, cost_ns=300 * NS_PER_MS)
    bench.run("real", 30_000)
    assert not bench.reports


def test_work_runs_ahead_of_wall_time(bench):
    ticks = bench.tick(10 * PS_PER_MS, until_ps=100 * PS_PER_S)
    bench.busy = lambda: bench.kernel.now < 100 * PS_PER_S
    bench.run("fast", 3000)
    worked_ms, end_ms = ticks[-1]
    assert (worked_ms, end_ms < 1000) == (100_000, True)
    served = sum(ms < end_ms for ms in bench.port.wall_ms)
    assert served > end_ms / (2 * SLICE_S * 1000)
    # When the work is done, virtual time follows wall time.
    passed_ms = bench.kernel.now / PS_PER_MS - 100_000
    assert 1000 < passed_ms < 3000
    assert min(bench.wall.waits) > 0.9 * IDLE_S


def test_fast_pace_runs_until_bytes_on_the_wire_have_arrived(bench):
    """Nothing is scheduled then, so there is no event to go to."""
    uart = Uart(bench.kernel, 10_000, lambda _byte: None, lambda: None, silence_bytes=100)
    bench.busy = lambda: uart.busy
    uart.send(bytes(5000))
    bench.port.releases = [i * PS_PER_MS for i in range(1, 5001)]
    bench.run("fast", 500)
    assert bench.port.releases == []
    assert 5 * PS_PER_S <= bench.kernel.now < 5.6 * PS_PER_S


def test_bytes_on_the_wire_do_not_cause_a_jump_to_a_far_event(bench):
    bench.kernel.timeout(3600 * PS_PER_S)
    bench.port.releases = [i * PS_PER_MS for i in range(1, 101)]
    bench.busy = lambda: bool(bench.port.releases)
    bench.run("fast", 500)
    assert bench.kernel.now < PS_PER_S


def test_arrived_bytes_are_delivered_before_time_advances(bench):
    bench.tick(PS_PER_MS)
    bench.busy = lambda: True
    bench.port.releases = [5 * PS_PER_MS + 1]
    bench.run("fast", 100)
    first = bench.port.exchanges.index(5 * PS_PER_MS + 1)
    assert bench.port.wall_ms[first] < SLICE_S * 1000  # at once


def test_slow_client_holds_virtual_time_back(bench):
    bench.tick(PS_PER_MS)
    bench.busy = lambda: True
    bench.port.congested = True
    bench.run("fast", 1000)
    assert bench.kernel.now / PS_PER_MS == pytest.approx(1000, abs=50)


def test_scheduler_sleeps_while_a_busy_device_has_no_events(bench):
    bench.busy = lambda: True
    bench.run("fast", 1000)
    assert min(bench.wall.waits) == IDLE_S


def test_scheduler_stopped_before_start_returns_at_once():
    scheduler = RealtimeScheduler(Kernel(), [], lambda: False, Pace(Kernel(), "real"))
    scheduler.stop()
    scheduler.run()


def test_scheduler_can_be_stopped_from_a_signal_handler(bench):
    scheduler = RealtimeScheduler(
        bench.kernel,
        [],
        lambda: False,
        Pace(bench.kernel, "real"),
        wait=lambda _watched, _timeout: signal.raise_signal(signal.SIGUSR1),
    )
    before = signal.signal(signal.SIGUSR1, lambda _number, _frame: scheduler.stop())
    try:
        scheduler.run()
    finally:
        signal.signal(signal.SIGUSR1, before)


@pytest.mark.parametrize("pace", ["real", "fast"])
def test_scheduler_can_be_stopped_from_another_thread_while_busy(bench, pace):
    bench.tick(PS_PER_MS)
    scheduler = RealtimeScheduler(bench.kernel, [], lambda: True, Pace(bench.kernel, pace))
    thread = threading.Thread(target=scheduler.run)
    thread.start()
    scheduler.stop()
    thread.join(20)
    assert not thread.is_alive()


def test_error_of_the_device_ends_the_run(bench):
    def process() -> Generator[Any, Any, None]:
        yield bench.kernel.timeout(PS_PER_MS)
        raise LookupError("the program is wrong")

    bench.kernel.process(process())
    with pytest.raises(LookupError, match="the program is wrong"):
        bench.run("real", 100)


@pytest.mark.parametrize(
    ("sent", "events", "timeout_s"),
    [(b"x", select.POLLIN, 3600), (b"", select.POLLOUT, 3600), (b"", select.POLLIN, 0.0001)],
)
def test_wait_ends_on_input_output_space_or_time_out(sent, events, timeout_s):
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.send(sent)
        realtime.wait_ready([(ours.fileno(), events)], timeout_s)  # hangs, if it does not
    realtime.wait_ready([], 0.0)


@pytest.mark.parametrize("pace", ["real", "fast"])
def test_virtual_time_stops_while_the_kernel_is_paused(bench, pace):
    ticks = bench.tick(10 * PS_PER_MS)
    kernel, wall, since = bench.kernel, bench.wall, []

    def process():
        yield kernel.timeout(105 * PS_PER_MS)
        kernel.hold("debugger")
        since.append(wall.ns)

    kernel.process(process())
    stop = bench.port.exchange

    def exchange(now_ps):
        if since and kernel.paused and wall.ns - since[0] > 2000 * NS_PER_MS:
            kernel.release("debugger")
            kernel.held_ns = wall.ns - since[0]
        stop(now_ps)

    bench.port.exchange = exchange
    bench.run(pace, 3000)
    virtual = [ms for ms, _ in ticks]
    assert virtual[10] == pytest.approx(110)
    assert ticks[10][1] - ticks[9][1] > 2000
    assert kernel.now / PS_PER_MS == pytest.approx(1000, abs=60)
    assert min(bench.wall.waits[12:100]) > IDLE_S / 2  # asleep meanwhile
    assert not bench.reports
