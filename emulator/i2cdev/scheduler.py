"""Serves programs on a bus: their calls come in, transfers run, answers go out in time.

The scheduler of all ports looks at each event, and at all ports between two of them. A transfer of
one byte takes less time on the wire than that, so here transfers are done in one go, and the next
call is awaited at once. Paced, virtual time runs ahead for that, and each answer is held back until
wall time gets to the end of its transfer.

When a transfer begins, paced: the way of a call to us and of the answer back is no part of a bus.

- A call within ``TURNAROUND_NS`` of the last transfer's answer begins where that transfer ended,
  so in the mean transfers one after the other take the wire's time. Answers that were late are made
  up for, up to ``MAX_DEBT_NS``; what a program itself does between two such calls is not counted.
- Any other call begins before it came: by the quickest way there and back that was seen so far, up
  to ``TURNAROUND_NS``, and by what the last answer was late, up to ``MAX_DEBT_NS``.
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
"""How far virtual time may be ahead of wall time during a transfer, when it is paced."""

TURNAROUND_NS = 200_000
"""How soon after an answer the next call belongs to the same loop of a program."""

MAX_DEBT_NS = 1_000_000
"""Lateness that is made up for; what is beyond it was lost to other work on this machine."""

SPIN_NS = 200_000
"""An answer that is due so soon is waited for without sleep, and waking comes that early."""

SPARE_NS = 30_000
"""Answers that are ready no longer than this before they are due are worth the processor time
that it takes to be quicker."""

VISIT_NS = 5_000_000
"""Wall time between two looks at the other ports."""


class I2cScheduler(Endpoint):
    """Ports that lead to one bus, as one port of the scheduler of all ports.

    Attributes:
        name: what it serves.
    """

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
            name: for messages.
            adapter: the master of the bus; from now on driven.
            ports: where calls come from; closed by their owner.
            busy: whether devices have work of their own.
            pace: how virtual time follows wall time; all other ports are so far back on its scale
                that a call may begin before it came.
            always_asleep: whether the next call is never waited for awake.
        """
        self.name = name
        self._kernel = adapter.env
        self._adapter = adapter
        self._ports = ports
        self._busy = busy
        self._pace = pace
        self._watch = Watch(ports, always_asleep=always_asleep)
        self._came_ns = self._answered_ns = self._told_ns = self._late_ns = self._spare_ns = 0
        self._quickest_ns = TURNAROUND_NS
        adapter.driven = True

    def _ahead_ps(self) -> int:
        """How far this port is ahead of the others on the scale of virtual time."""
        return 0 if self._pace.fast else round(TURNAROUND_NS * PS_PER_NS * self._pace.speed)

    def watched(self) -> list[tuple[int, int]]:
        """Those of all its ports."""
        return [item for port in self._ports for item in port.watched()]

    def release_ps(self, count: int) -> int | None:
        """When the next answer is due, on the scale of the other ports."""
        due_ps = self._adapter.release_ps()
        return None if due_ps is None else due_ps - self._ahead_ps()

    def close(self) -> None:
        """Watch no longer; the ports are their owner's."""
        self._watch.close()

    def exchange(self, now_ps: int) -> None:
        """Serve calls; goes on as long as they come one after the other, up to ``VISIT_NS``."""
        if self._kernel.paused:
            return
        self._adapter.holding = not self._pace.fast
        came = bool(self._watch.wait(0))
        self._serve(self._ports, came=came)
        leave_ns = self._pace.now_ns() + VISIT_NS
        while self._turn() or (self._pace.now_ns() < leave_ns and self._await_call()):
            pass

    def _serve(self, ports: Iterable[Endpoint], *, came: bool) -> None:
        """Look at ``ports``; ``came`` says whether there is something to see."""
        if came:
            self._came_ns = self._pace.now_ns()
            self._quickest_ns = min(self._quickest_ns, self._came_ns - self._answered_ns)
        now_ps = self._kernel.now
        for port in ports:
            port.exchange(now_ps)
        if came and not self._pending():  # calls without a transfer are answered at once
            self._answered_ns = self._pace.now_ns()

    def _pending(self) -> bool:
        """Whether an answer is due."""
        return self._adapter.busy or self._adapter.release_ps() is not None

    def _turn(self) -> bool:
        """Go on with a transfer or give an answer; returns whether it came to an end."""
        adapter = self._adapter
        if adapter.busy:
            told = adapter.told
            self._drive()
            if adapter.told > told:
                self._answered_ns = self._told_ns = self._pace.now_ns()
                return True
            if adapter.busy and not adapter.beginning:
                return False
        due_ps = adapter.release_ps()
        return due_ps is not None and self._release(due_ps)

    def _drive(self) -> None:
        """Run transfers as far as virtual time may."""
        kernel, adapter = self._kernel, self._adapter
        clock = self._pace.clock_ns
        end_ns = clock() + VISIT_NS
        if self._pace.fast:

            def goes_on() -> bool:
                return clock() < end_ns and not kernel.paused
        else:
            if adapter.beginning:
                kernel.advance_to(self._pace.ps_at(self._start_ns()) + self._ahead_ps())
            limit_ps = self._pace.now_ps() + self._ahead_ps() + AHEAD_PS

            def goes_on() -> bool:
                ahead = (kernel.horizon() or 0) > limit_ps
                return clock() < end_ns and not ahead and not kernel.paused

        adapter.drive(goes_on)
        while kernel.horizon() == kernel.now and not kernel.paused:  # what is left of it
            kernel.step()

    def _start_ns(self) -> int:
        """When a call that has come begins on the wire, unless that is busy still."""
        if self._came_ns - self._told_ns <= TURNAROUND_NS:
            return self._came_ns - MAX_DEBT_NS
        way_ns = self._quickest_ns if self._quickest_ns < TURNAROUND_NS else 0
        return self._came_ns - way_ns - min(self._late_ns, MAX_DEBT_NS)

    def _release(self, due_ps: int) -> bool:
        """Give the answer that is due next, unless that is too far away."""
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
        self._answered_ns = self._told_ns = self._pace.now_ns()
        return True

    def _await_call(self) -> bool:
        """Virtual time stands still for a moment: most programs call again at once."""
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
    """A scheduler for ``endpoints`` and a bus, to be run in a ``with`` block.

    Serial ports alone are served by a :class:`RealtimeScheduler`. With an I2C bus, an
    :class:`I2cScheduler` stands before it: it takes the bus's calls as they come. ``run()`` serves
    until ``stop()``, which a thread, a signal handler or a port may call::

        with open_scheduler(board.kernel, [endpoint], board.busy, pace="fast") as scheduler:
            signal.signal(signal.SIGINT, lambda _number, _frame: scheduler.stop())
            scheduler.run()

    Args:
        kernel: that of the boards; its time is in ps.
        endpoints: open ports other than those of the bus; closed by their owner, as all ports.
        busy: whether the boards have work of their own.
        pace: "real" (virtual time is wall time) or "fast" (ahead of it while there is work).
        i2c: master of the boards' I2C bus; None when no program can reach that.
        i2c_ports: where the calls for ``i2c`` come from, for instance an I2cServer.
        always_asleep: whether the next call is never waited for awake, as the caller needs this
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
