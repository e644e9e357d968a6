import os
from collections.abc import Callable

import pytest

from cubestack.emulator.i2cdev import pacing
from cubestack.emulator.i2cdev.pacing import ALONE_AGAIN_NS, CROWDED_NS, Watch
from cubestack.emulator.ports.endpoint import Endpoint

TIMEOUT_NS = 100_000
QUICK_NS = 1_000


class World:
    """Time, and what a wait does to it; a call comes when it is ``due``."""

    def __init__(self) -> None:
        self.now_ns = 10**12
        self.yield_ns = QUICK_NS
        self.yields = 0
        self.due_ns: int | None = None

    def monotonic_ns(self) -> int:
        return self.now_ns

    def sched_yield(self) -> None:
        self.yields += 1
        self.now_ns += self.yield_ns

    def poll(self, timeout_s: float) -> list[tuple[int, int]]:
        due_ns = self.now_ns + 10**15 if self.due_ns is None else self.due_ns
        self.now_ns = min(max(due_ns, self.now_ns), self.now_ns + round(timeout_s * 1e9))
        return [(Port.FD, 1)] if due_ns <= self.now_ns else []

    def close(self) -> None: ...


class Port(Endpoint):
    FD = 5

    def watched(self) -> list[tuple[int, int]]:
        return [(self.FD, 1)]

    def exchange(self, now_ps: int) -> None: ...

    def close(self) -> None: ...


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    made = World()
    monkeypatch.setattr(pacing, "time", made)
    monkeypatch.setattr(os, "sched_yield", made.sched_yield)
    return made


@pytest.fixture
def watch(world: World, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Watch]:
    def make(*, first: bool, **options: bool) -> Watch:
        monkeypatch.setattr(os, "sched_getscheduler", lambda _pid: os.SCHED_FIFO if first else 0)
        made = Watch([Port()], **options)
        made.close()
        made._poller = world  # type: ignore[assignment]
        monkeypatch.setattr(made, "_change", lambda _watched: None)
        return made

    return make


@pytest.mark.parametrize("first", [False, True])
def test_call_is_seen_immediately(world, watch, first):
    waiting = watch(first=first)
    world.due_ns = world.now_ns + 30_500
    assert len(waiting.wait(TIMEOUT_NS, awake=True)) == 1
    assert world.now_ns - world.due_ns < QUICK_NS
    assert world.yields == 31


def test_wait_respects_its_time_limit(world, watch):
    waiting = watch(first=False)
    for awake in (True, False):
        began_ns = world.now_ns
        assert waiting.wait(TIMEOUT_NS, awake=awake) == []
        assert world.now_ns - began_ns == TIMEOUT_NS


def test_waiter_with_peers_sleeps_briefly(world, watch):
    waiting = watch(first=False)
    world.yield_ns = 2 * CROWDED_NS
    for pause_ns, yields in ((0, 1), (0, 1), (ALONE_AGAIN_NS, 2)):
        world.now_ns += pause_ns
        waiting.wait(TIMEOUT_NS, awake=True)
        assert world.yields == yields


def test_prioritised_waiter_sleeps_only_when_woken_quickly(world, watch):
    world.yield_ns = 2 * CROWDED_NS
    for always_asleep, yields in ((False, 3), (True, 3)):
        waiting = watch(first=True, always_asleep=always_asleep)
        for _ in range(3):
            waiting.wait(TIMEOUT_NS, awake=True)
        assert world.yields == yields
