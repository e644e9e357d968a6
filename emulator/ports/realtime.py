"""The scheduler that alternates between virtual time and the open ports.

With pace "real", virtual time follows wall time; the scheduler reports the lag when the machine is
too slow. With pace "fast", virtual time runs ahead while the device has work or bytes are on a
wire, and follows wall time while everything waits for the host, or a client reads too slowly.

While the kernel is paused, virtual time stops and the ports stay open. Paused wall time does not
count, so the emulation does not catch up afterwards.
"""

import select
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.emulator.ports.pace import Pace
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

SLICE_S = 0.005
"""Wall time between two exchanges of the ports while there are events."""

IDLE_S = 0.02
"""Longest wait; a new client of a pseudo-terminal and ``stop`` are noticed within it."""

BURST_BYTES = 4096
"""Bytes from the device between two exchanges, to notice in time that a client is slow."""

LAG_REPORTED_S = 0.5
LAG_REPORT_S = 5.0
"""Shortest wall time between two reports of a lag."""

NS_PER_S = 10**9

Watched = Sequence[tuple[int, int]]


def wait_ready(watched: Watched, timeout_s: float) -> None:
    """Wait until one of the ``watched`` (descriptor, events) is ready, at most ``timeout_s``.

    The time-out is rounded up to a millisecond, so an active line does not cost a wake-up per byte.
    """
    poller = select.poll()
    for fileno, events in watched:
        poller.register(fileno, events)
    poller.poll(timeout_s * 1000)


@dataclass
class RealtimeScheduler:
    """Runs an environment against endpoints until it is stopped."""

    env: Kernel
    endpoints: Sequence[Endpoint]
    busy: Callable[[], bool]  # whether the device has work, or bytes are on a wire
    pace: Pace  # relation of virtual time to wall time (see the module)
    # receives a line when pace "real" can not be kept
    report: Callable[[str], None] = lambda _text: None
    # waits for descriptors with a time-out in s, as ``wait_ready``
    wait: Callable[[Watched, float], None] = wait_ready

    def __post_init__(self) -> None:
        self._stopped = False
        self._reported_ns = self.pace.clock_ns()

    def stop(self) -> None:
        """Make ``run`` return soon; may be called by other threads and signal handlers."""
        self._stopped = True

    def run(self) -> None:
        self.pace.align()
        while not self._stopped:
            ahead = self.pace.fast and self._run_ahead()
            if ahead:
                self.pace.align()
            elif not self.env.paused:
                self._follow()
            for endpoint in self.endpoints:
                endpoint.exchange(self.env.now)
            if not ahead:
                watched = [item for endpoint in self.endpoints for item in endpoint.watched()]
                self.wait(watched, self._until_next_s())

    def _slice_end_ns(self) -> int:
        return self.pace.clock_ns() + int(SLICE_S * NS_PER_S)

    def _run_ahead(self) -> bool:
        """Run for a slice of wall time, or until everything waits for the host.

        Returns False if there was nothing to do, or a client reads too slowly.
        """
        if any(endpoint.congested for endpoint in self.endpoints):
            return False
        progress = False
        end_ns = self._slice_end_ns()
        while self.pace.clock_ns() < end_ns and not self.env.paused:
            horizon, release = self.env.horizon(), self._release_ps(BURST_BYTES)
            if release is None and not self.busy():
                break
            if release is not None and release <= self.env.now:
                break  # deliver these bytes first
            if horizon is not None and (release is None or horizon <= release):
                self.env.step()
            elif release is not None:
                self.env.advance_to(release)
            else:
                break
            progress = True
        return progress

    def _release_ps(self, count: int) -> int | None:
        """When an endpoint has ``count`` bytes from the device, or all that it will get."""
        releases = [endpoint.release_ps(count) for endpoint in self.endpoints]
        return min((ps for ps in releases if ps is not None), default=None)

    def _follow(self) -> None:
        """Advance virtual time to wall time, at most for a slice of wall time."""
        target_ps = self.pace.now_ps()
        end_ns = self._slice_end_ns()
        while (horizon := self.env.horizon()) is not None and horizon <= target_ps:
            self.env.step()
            if self.pace.clock_ns() >= end_ns or self.env.paused:
                break
        else:
            self.env.advance_to(target_ps)
        self._report_lag((self.pace.now_ps() - self.env.now) / PS_PER_S)

    def _report_lag(self, lag_s: float) -> None:
        now_ns = self.pace.clock_ns()
        due_ns = self._reported_ns + int(LAG_REPORT_S * NS_PER_S)
        if lag_s > LAG_REPORTED_S and now_ns >= due_ns:
            self._reported_ns = now_ns
            self.report(f"can not keep real time: {lag_s:.1f} s behind")

    def _until_next_s(self) -> float:
        if self.env.paused:
            return IDLE_S
        times = [ps for ps in (self._release_ps(1), self.env.horizon()) if ps is not None]
        if not times:
            return IDLE_S
        left_s = (min(times) - self.pace.now_ps()) / PS_PER_S / self.pace.speed
        return min(IDLE_S, max(0.0, left_s))
