"""Serves programs on a bus: receives their calls, runs transfers, and answers on time.

The scheduler of all ports serves every port between two events. A transfer of one byte takes less
time on the wire than that. This scheduler therefore runs each transfer in one step, and then waits
for the next call at once. With pace "real", virtual time runs ahead for that, and each answer is
held back until wall time reaches the end of its transfer.

With pace "real", the start of a transfer excludes the travel of calls and answers between the
processes, which no real bus has:

- A call within ``TURNAROUND_NS`` of the last transfer's answer begins at the end of that transfer,
  so consecutive transfers take the wire's time on average. Late answers are compensated, up to
  ``MAX_DEBT_NS``; the program's own time between two such calls is not counted.
- Any other call begins before its arrival: by the shortest round trip so far, up to
  ``TURNAROUND_NS``, and by the delay of the last answer, up to ``MAX_DEBT_NS``.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager

from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.pacing import Watch, sharpen_timers, wait_precisely
from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.emulator.ports.pace import PS_PER_NS, Mode, Pace
from cubestack.emulator.ports.realtime import RealtimeScheduler
from cubestack.emulator.sim.virtual_time import PS_PER_MS, Kernel

AHEAD_PS = 2 * PS_PER_MS
"""Limit of virtual time ahead of wall time during a transfer, with pace "real"."""

TURNAROUND_NS = 200_000
"""Time after an answer within which the next call counts as consecutive."""

MAX_DEBT_NS = 1_000_000
"""Limit of compensated delay; more was lost to other processes on this machine."""

SPIN_NS = 200_000
"""An answer that is due within this time is awaited without sleep."""

SPARE_NS = 30_000
"""If answers are ready less than this before they are due, busy-waiting for calls is worthwhile."""

VISIT_NS = 5_000_000
"""Wall time between two exchanges of the other ports."""


class I2cScheduler(Endpoint):
    """The ports of one bus, as one port of the scheduler of all ports."""

    def __init__(
        self,
        name: str,
        adapter: I2cAdapter,
        ports: Sequence[Endpoint],
        busy: Callable[[], bool],
        pace: Pace,
        *,
        always_asleep: bool = False,
    ) -> None:
        """Serve ``ports``, whose calls go to ``adapter``.

        Args:
            name: name in messages.
            adapter: the master of the bus, which becomes ``driven``.
            ports: sources of calls; the caller closes them.
            busy: whether devices have work without the host.
            pace: relation of virtual time to wall time. All other ports are behind on its scale, so
                that a call may begin before its arrival.
            always_asleep: whether to wait for calls without busy-waiting.
        """
        self.name = name
        self._kernel = adapter.env
        self._adapter = adapter
        self._ports = ports
        self._busy = busy
        self._pace = pace
        self._watch = Watch(ports, always_asleep=always_asleep)
        self._called_ns = self._answered_ns = self._ended_ns = self._late_ns = self._spare_ns = 0
        self._quickest_ns = TURNAROUND_NS
        adapter.driven = True

    def _ahead_ps(self) -> int:
        """Lead of this port over the others on the scale of virtual time."""
        return 0 if self._pace.fast else round(TURNAROUND_NS * PS_PER_NS * self._pace.speed)

    def watched(self) -> list[tuple[int, int]]:
        return [item for port in self._ports for item in port.watched()]

    def release_ps(self, count: int) -> int | None:
        """When the next answer is due, on the scale of the other ports."""
        due_ps = self._adapter.release_ps()
        return None if due_ps is None else due_ps - self._ahead_ps()

    def close(self) -> None:
        self._watch.close()

    def exchange(self, now_ps: int) -> None:
        """Serve calls; continues for up to ``VISIT_NS`` while they are consecutive."""
        if self._kernel.paused:
            return
        self._adapter.holding = not self._pace.fast
        came = bool(self._watch.wait(0))
        self._serve(self._ports, came=came)
        leave_ns = self._pace.now_ns() + VISIT_NS
        while self._turn() or (self._pace.now_ns() < leave_ns and self._await_call()):
            pass

    def _serve(self, ports: Iterable[Endpoint], *, came: bool) -> None:
        if came:
            self._called_ns = self._pace.now_ns()
            self._quickest_ns = min(self._quickest_ns, self._called_ns - self._answered_ns)
        now_ps = self._kernel.now
        for port in ports:
            port.exchange(now_ps)
        if came and not self._pending():  # calls without a transfer are answered at once
            self._answered_ns = self._pace.now_ns()

    def _pending(self) -> bool:
        return self._adapter.busy or self._adapter.release_ps() is not None

    def _turn(self) -> bool:
        """Continue a transfer or return an answer; whether one ended."""
        adapter = self._adapter
        if adapter.busy:
            answered = adapter.answered
            self._drive()
            if adapter.answered > answered:
                self._answered_ns = self._ended_ns = self._pace.now_ns()
                return True
            if adapter.busy and not adapter.begins_transfer:
                return False
        due_ps = adapter.release_ps()
        return due_ps is not None and self._release(due_ps)

    def _drive(self) -> None:
        """Run transfers as far as virtual time may go."""
        kernel, adapter = self._kernel, self._adapter
        clock = self._pace.clock_ns
        end_ns = clock() + VISIT_NS
        if self._pace.fast:

            def may_continue() -> bool:
                return clock() < end_ns and not kernel.paused
        else:
            if adapter.begins_transfer:
                kernel.advance_to(self._pace.ps_at(self._start_ns()) + self._ahead_ps())
            limit_ps = self._pace.now_ps() + self._ahead_ps() + AHEAD_PS

            def may_continue() -> bool:
                ahead = (kernel.horizon() or 0) > limit_ps
                return clock() < end_ns and not ahead and not kernel.paused

        adapter.drive(may_continue)
        while kernel.horizon() == kernel.now and not kernel.paused:  # remaining events at this time
            kernel.step()

    def _start_ns(self) -> int:
        """When an arrived call begins on the wire, unless that is still busy."""
        if self._called_ns - self._ended_ns <= TURNAROUND_NS:
            return self._called_ns - MAX_DEBT_NS
        way_ns = self._quickest_ns if self._quickest_ns < TURNAROUND_NS else 0
        return self._called_ns - way_ns - min(self._late_ns, MAX_DEBT_NS)

    def _release(self, due_ps: int) -> bool:
        clock_ns, due_ns = self._pace.now_ns, self._pace.ns_at(due_ps - self._ahead_ps())
        left_ns = 0 if self._pace.fast else due_ns - clock_ns()
        if left_ns > SPIN_NS:
            return False
        self._spare_ns = left_ns
        self._watch.nap(left_ns)
        while left_ns > 0 and clock_ns() < due_ns:
            pass
        now_ns = clock_ns()
        self._late_ns = max(0, now_ns - due_ns)
        self._adapter.release(max(due_ps, self._pace.ps_at(now_ns) + self._ahead_ps()))
        self._answered_ns = self._ended_ns = self._pace.now_ns()
        return True

    def _await_call(self) -> bool:
        """Stop virtual time for a moment, as most programs call again at once."""
        if self._pending() or (self._pace.fast and self._busy()):
            return False
        left_ns = self._answered_ns + TURNAROUND_NS - self._pace.now_ns()
        if left_ns <= 0:
            return False
        awake = self._pace.fast or self._spare_ns < SPARE_NS
        ready = self._watch.wait(left_ns, awake=awake)
        if ready:
            self._serve(ready, came=True)
        return bool(ready)


@contextmanager
def open_scheduler(
    kernel: Kernel,
    endpoints: Sequence[Endpoint],
    busy: Callable[[], bool],
    *,
    pace: Mode,
    i2c: I2cAdapter | None = None,
    i2c_ports: Sequence[Endpoint] = (),
    always_asleep: bool = False,
    report: Callable[[str], None] = lambda _text: None,
) -> Iterator[RealtimeScheduler]:
    """A scheduler for ``endpoints`` and a bus, for a ``with`` block.

    A :class:`RealtimeScheduler` serves the ports; with an I2C bus, one of its ports is an
    :class:`I2cScheduler`, which handles calls as they come. ``run()`` serves until ``stop()``,
    which a thread, a signal handler or a port may call::

        with open_scheduler(board.kernel, [endpoint], board.busy, pace="fast") as scheduler:
            signal.signal(signal.SIGINT, lambda _number, _frame: scheduler.stop())
            scheduler.run()

    Args:
        kernel: kernel of the boards.
        endpoints: open ports other than those of the bus; the caller closes all ports.
        busy: whether the boards have work without the host.
        pace: "real" (virtual time is wall time) or "fast" (ahead of it while there is work).
        i2c: master of the boards' I2C bus; None if no program can reach that.
        i2c_ports: sources of calls for ``i2c``, for instance an I2cServer.
        always_asleep: whether to wait for calls without busy-waiting, as the program needs this
            processor.
        report: receives a line when pace "real" can not be kept.
    """
    scale = Pace(kernel, pace)
    if i2c is None:
        yield RealtimeScheduler(kernel, endpoints, busy, scale, report=report)
        return
    adapter = i2c
    sharpen_timers()
    calls = I2cScheduler("I2C bus", adapter, i2c_ports, busy, scale, always_asleep=always_asleep)
    try:
        yield RealtimeScheduler(
            kernel,
            [calls, *endpoints],
            lambda: adapter.busy or busy(),
            scale,
            report=report,
            wait=wait_precisely,
        )
    finally:
        calls.close()
