"""The pump: alternates between virtual time and the open ports.

Paced "real", virtual time follows wall time; when the machine can not keep up, the pump says by
how much. Paced "fast", virtual time runs ahead as long as the device has work or bytes are on a
wire, and follows wall time while everything waits for the host.
"""

import time
from collections.abc import Callable, Sequence
from typing import Literal

from cubestack.emulator.ports.endpoint import Endpoint, wait_readable
from cubestack.emulator.virtual_time import PS_PER_S, Kernel

__all__ = ["Pump"]

SLICE_S = 0.005  # wall time between two looks at the ports while time runs ahead
IDLE_S = 0.05  # longest sleep; Ctrl-C and stop() are noticed within it
LAG_REPORT_S = 5.0
LAG_WORTH_SAYING_S = 0.5


class Pump:
    """Runs an environment against endpoints until it is stopped."""

    def __init__(
        self,
        env: Kernel,
        endpoints: Sequence[Endpoint],
        busy: Callable[[], bool],
        *,
        pace: Literal["real", "fast"],
        report: Callable[[str], None] = lambda _text: None,
    ) -> None:
        """Prepare to serve.

        Args:
            env: kernel; its time is in ps.
            endpoints: open ports.
            busy: whether the device has work, or bytes are on a wire.
            pace: see the module's text.
            report: receives a line when pace "real" can not be kept.
        """
        self._env = env
        self._endpoints = endpoints
        self._busy = busy
        self._fast = pace == "fast"
        self._report = report
        self._stopped = False

    def stop(self) -> None:
        """Make ``run`` return soon; may be called from another thread."""
        self._stopped = True

    def run(self) -> None:
        """Serve until ``stop``."""
        offset_ps = self._env.now - int(time.monotonic() * PS_PER_S)
        reported = time.monotonic()
        while not self._stopped:
            for endpoint in self._endpoints:
                endpoint.exchange(self._env.now)
            if self._fast and (self._busy() or self._pending()):
                self._run_ahead()
                offset_ps = self._env.now - int(time.monotonic() * PS_PER_S)
                continue
            target = int(time.monotonic() * PS_PER_S) + offset_ps
            self._advance(target)
            lag_s = (int(time.monotonic() * PS_PER_S) + offset_ps - self._env.now) / PS_PER_S
            if lag_s > LAG_WORTH_SAYING_S and time.monotonic() - reported > LAG_REPORT_S:
                reported = time.monotonic()
                self._report(f"can not keep real time: {lag_s:.1f} s behind")
            for endpoint in self._endpoints:
                endpoint.exchange(self._env.now)
            filenos = [fd for endpoint in self._endpoints for fd in endpoint.filenos()]
            wait_readable(filenos, self._until_next_s(offset_ps))

    def _pending(self) -> bool:
        return any(endpoint.next_release_ps() is not None for endpoint in self._endpoints)

    def _run_ahead(self) -> None:
        """Run for a slice of wall time, or until everything waits for the host."""
        end = time.monotonic() + SLICE_S
        while time.monotonic() < end:
            releases = [endpoint.next_release_ps() for endpoint in self._endpoints]
            release = min((t for t in releases if t is not None), default=None)
            horizon = self._env.horizon()
            if self._busy() and horizon is not None and (release is None or horizon <= release):
                self._env.step()
                continue
            if release is not None:
                self._advance(release)
            return

    def _advance(self, target_ps: int) -> None:
        """Run to ``target_ps``, but not for longer than a slice of wall time."""
        end = time.monotonic() + SLICE_S
        while self._env.peek() <= target_ps:
            self._env.step()
            if time.monotonic() > end:
                return
        if target_ps > self._env.now:
            self._env.run(until=target_ps)

    def _until_next_s(self, offset_ps: int) -> float:
        """Wall time until something is due, at most ``IDLE_S``."""
        due = [t for t in (e.next_release_ps() for e in self._endpoints) if t is not None]
        horizon = self._env.horizon()
        if horizon is not None:
            due.append(horizon)
        if not due:
            return IDLE_S
        wall_ps = int(time.monotonic() * PS_PER_S) + offset_ps
        return min(IDLE_S, max(0.0, (min(due) - wall_ps) / PS_PER_S))
