"""Waiting awake, in a made-up wall time."""

import os

import pytest

from cubestack.emulator.i2cdev import pacing
from cubestack.emulator.i2cdev.pacing import ALONE_AGAIN_NS, CROWDED_NS, Watch

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


class Port:
    FD = 5
    name = "port"
    congested = False

    def watched(self) -> list[tuple[int, int]]:
        return [(self.FD, 1)]

    def exchange(self, now_ps: int) -> None: ...

    def release_ps(self, count: int) -> int | None: ...

    def close(self) -> None: ...


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    made = World()
    monkeypatch.setattr(pacing, "time", made)
    monkeypatch.setattr(os, "sched_yield", made.sched_yield)
    return made


def watch(world: World, monkeypatch: pytest.MonkeyPatch, *, first: bool, **options: bool) -> Watch:
    monkeypatch.setattr(os, "sched_getscheduler", lambda _pid: os.SCHED_FIFO if first else 0)
    made = Watch([Port()], **options)
    made.close()
    made._poller = world  # type: ignore[assignment]
    made._watched = {Port.FD: Port()}
    monkeypatch.setattr(made, "_change", lambda watched: setattr(made, "_watched", watched))
    return made


@pytest.mark.parametrize("first", [False, True])
def test_a_call_that_comes_is_seen_at_once(world, monkeypatch, first):
    waiting = watch(world, monkeypatch, first=first)
    world.due_ns = world.now_ns + 30_500
    assert len(waiting.wait(TIMEOUT_NS, awake=True)) == 1
    assert world.now_ns - world.due_ns < QUICK_NS
    assert world.yields == 31


def test_a_wait_ends_in_time(world, monkeypatch):
    waiting = watch(world, monkeypatch, first=False)
    for awake in (True, False):
        began_ns = world.now_ns
        assert waiting.wait(TIMEOUT_NS, awake=awake) == []
        assert world.now_ns - began_ns == TIMEOUT_NS


def test_who_is_not_alone_sleeps_for_a_while(world, monkeypatch):
    waiting = watch(world, monkeypatch, first=False)
    world.yield_ns = 2 * CROWDED_NS
    waiting.wait(TIMEOUT_NS, awake=True)
    assert world.yields == 1
    waiting.wait(TIMEOUT_NS, awake=True)
    assert world.yields == 1
    world.now_ns += ALONE_AGAIN_NS
    waiting.wait(TIMEOUT_NS, awake=True)
    assert world.yields == 2


def test_who_has_priority_never_sleeps(world, monkeypatch):
    waiting = watch(world, monkeypatch, first=True)
    world.yield_ns = 2 * CROWDED_NS
    for count in range(1, 4):
        waiting.wait(TIMEOUT_NS, awake=True)
        assert world.yields == count


def test_who_is_woken_quickly_always_sleeps(world, monkeypatch):
    waiting = watch(world, monkeypatch, first=True, always_asleep=True)
    waiting.wait(TIMEOUT_NS, awake=True)
    assert world.yields == 0
