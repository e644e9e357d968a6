"""Acts of other threads on a running emulation: when they happen, and what time does then."""

import itertools
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.ports import control
from cubestack.emulator.ports.control import MOST_EVENTS, ControlPort
from cubestack.emulator.ports.endpoint import poll_now
from cubestack.emulator.ports.pace import Pace
from cubestack.emulator.ports.realtime import RealtimeScheduler
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_S, Kernel

from .conftest import Wall

SOON_S = 20.0


@dataclass
class Running:
    """An emulation that ticks every ms of virtual time, in a thread."""

    pace: Any = "real"
    kernel: Kernel = field(default_factory=Kernel)
    ticks: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.port = ControlPort(self.kernel)
        self.scheduler = RealtimeScheduler(
            self.kernel, [self.port], lambda: False, Pace(self.kernel, self.pace)
        )
        self.port.scheduler = self.scheduler
        self.kernel.process(self._tick())
        self.thread = threading.Thread(target=self.scheduler.run)

    def _tick(self) -> Iterator[Any]:
        while True:
            self.ticks.append(self.kernel.now)
            yield self.kernel.timeout(PS_PER_MS)

    def ask(self, act: Callable[[], Any]) -> Any:
        return self.port.call(act).result(SOON_S)

    def end(self) -> None:
        self.scheduler.stop()
        self.thread.join(SOON_S)
        self.port.close()


@pytest.fixture(params=["real", "fast"])
def running(request: pytest.FixtureRequest) -> Iterator[Running]:
    running = Running(request.param)
    running.thread.start()
    yield running
    running.end()


def test_control_calls_run_in_the_emulation_thread(running: Running) -> None:
    assert running.ask(threading.get_ident) == running.thread.ident


def test_call_raises_its_error_in_the_caller(running: Running) -> None:
    with pytest.raises(ZeroDivisionError):
        running.ask(lambda: 1 // 0)
    assert running.ask(lambda: 7) == 7


def test_time_stops_while_held(running: Running) -> None:
    port = running.port
    held_ps = running.ask(lambda: (port.pause(), running.kernel.now)[1])
    looks = [running.ask(lambda: (port.held, running.kernel.now)) for _ in range(20)]
    assert set(looks) == {(True, held_ps)}
    running.ask(port.resume)
    assert not running.ask(lambda: port.held)


def test_step_advances_by_single_events(running: Running) -> None:
    running.ask(running.port.pause)
    before = len(running.ticks)
    assert running.ask(running.port.step) == 1
    assert len(running.ticks) == before + 1
    assert running.ask(lambda: running.port.step(50)) == 50
    assert len(running.ticks) == before + 51
    assert running.ask(lambda: running.port.held)


def test_runs_to_a_time_and_stops(running: Running) -> None:
    goal_ps = 30 * PS_PER_S  # far more than passes on the wall
    arrived: Future[int] = running.ask(lambda: running.port.run_to(goal_ps))
    assert arrived.result(SOON_S) == goal_ps
    assert running.ask(lambda: (running.port.held, running.kernel.now)) == (True, goal_ps)
    assert running.ticks[-1] == goal_ps - PS_PER_MS  # what happens at that time comes after it
    with pytest.raises(ValueError, match=r"the time is already 30\.000000 s"):
        running.ask(lambda: running.port.run_to(PS_PER_S))


def test_serves_other_ports_every_20_ms_during_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a wall clock that goes on by 6 ms with each event; nobody serves but the test."""
    wall_ns = itertools.count(0, 6_000_000)
    monkeypatch.setattr(control, "time", SimpleNamespace(monotonic_ns=lambda: next(wall_ns)))
    running = Running()
    port, kernel = running.port, running.kernel
    arrived = port.run_to(10 * PS_PER_MS)
    ticks = []
    while not arrived.done():
        assert [poll_now(fd, events) for fd, events in port.watched()] == [True]
        port.exchange(kernel.now)
        ticks.append(len(running.ticks))
        assert port.held
    assert ticks == [4, 8, 10]  # four take 24 ms; a tick at the end would come after it
    port.close()


def test_pause_request_ends_a_run(running: Running) -> None:
    arrived: Future[int] = running.ask(lambda: running.port.run_to(10**9 * PS_PER_S))
    running.ask(running.port.pause)
    with pytest.raises(RuntimeError, match="the run was held before its end"):
        arrived.result(SOON_S)


@pytest.mark.parametrize("running", ["real"], indirect=True)
def test_real_pace_does_not_catch_up_after_a_jump(running: Running) -> None:
    arrived: Future[int] = running.ask(lambda: running.port.run_to(100 * PS_PER_S))
    arrived.result(SOON_S)
    running.ask(running.port.resume)
    now_s = running.ask(lambda: running.kernel.now / PS_PER_S)
    assert 100 <= now_s < 100 + SOON_S


@pytest.mark.parametrize("speed", [0.5, 20.0])
def test_pace_speed_is_kept_on_a_simulated_wall_clock(speed: float) -> None:
    wall, kernel = Wall(), Kernel()

    def wait(watched: Any, timeout_s: float) -> None:
        wall.wait(watched, timeout_s)
        if wall.ms > 2000:
            scheduler.stop()

    port = ControlPort(kernel)
    scheduler = RealtimeScheduler(
        kernel, [port], lambda: False, Pace(kernel, "real", wall.clock), wait=wait
    )
    port.scheduler = scheduler
    port.set_pace("real", speed)
    scheduler.run()
    assert kernel.now / PS_PER_S == pytest.approx(2 * speed, rel=0.02)
    port.close()


def test_speeds_have_limits(running: Running) -> None:
    for speed in (0.0, -1.0, float("nan"), 1e6):
        with pytest.raises(ValueError, match=r"0\.001 to 1000"):
            running.ask(partial(running.port.set_pace, "real", speed))
    for events in (0, -1, MOST_EVENTS + 1):
        with pytest.raises(ValueError, match=f"1 to 100000 events, not {events}"):
            running.ask(partial(running.port.step, events))


def test_control_step_reports_another_holder_of_time(running: Running) -> None:
    running.ask(lambda: running.kernel.hold("debugger"))
    with pytest.raises(ValueError, match="held by the debugger"):
        running.ask(running.port.step)
    running.ask(running.port.resume)
    assert running.ask(lambda: running.port.held)


def test_call_after_the_end_raises() -> None:
    running = Running()
    waiting = running.port.call(lambda: 1)  # nobody serves
    running.port.close()
    for asked in (waiting, running.port.call(lambda: 2)):
        with pytest.raises(RuntimeError, match="the emulation has ended"):
            asked.result(SOON_S)


class Desk:
    def __init__(self, mode: str = "real", ns: int = 1_000_000_007) -> None:
        self.ns, self.kernel = ns, Kernel()
        self.pace = Pace(self.kernel, mode, lambda: self.ns)  # type: ignore[arg-type]


def test_pace_starts_at_the_current_virtual_time() -> None:
    desk = Desk()
    assert (desk.pace.now_ps(), desk.pace.now_ns()) == (0, desk.ns)
    desk.ns += 5
    assert desk.pace.now_ps() == 5000
    desk.kernel.run(until=7_000_000)
    desk.pace.align()
    assert desk.pace.now_ps() == 7_000_000
    desk.ns += 3
    assert desk.pace.now_ps() == 7_003_000


@pytest.mark.parametrize("speed", [1.0, 2.0, 0.25, 3.7])
def test_speed_change_applies_from_its_time_on(speed: float) -> None:
    desk = Desk()
    desk.ns += 1000
    desk.kernel.run(until=desk.pace.now_ps())
    desk.pace.change("real", speed)
    assert desk.pace.now_ps() == pytest.approx(1_000_000, abs=1)
    desk.ns += 2000
    assert desk.pace.now_ps() == pytest.approx(1_000_000 + 2_000_000 * speed, abs=2)


@pytest.mark.parametrize("speed", [1.0, 2.0, 0.5, 3.7])
def test_pace_conversions_are_inverse_and_never_early(speed: float) -> None:
    desk = Desk()
    desk.kernel.run(until=12_345)
    desk.pace.change("real", speed)
    for ps in (12_345, 12_346, 13_345, 13_344, 999_999, 10**9 + 1):
        ns = desk.pace.ns_at(ps)
        assert desk.pace.ps_at(ns) >= ps - 1
        assert desk.pace.ps_at(ns - 1) < ps
    if speed == 1.0:
        at = desk.pace.now_ns()
        assert [desk.pace.ns_at(12_345 + ps) - at for ps in (0, 1, 1000, 1001)] == [0, 1, 1, 2]


def test_pace_mode_is_fast_or_real() -> None:
    desk = Desk("fast")
    assert desk.pace.fast
    desk.pace.change("real")
    assert not desk.pace.fast
    assert desk.pace.speed == 1.0
