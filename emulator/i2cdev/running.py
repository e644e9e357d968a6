"""Runs a program with an emulated bus, from its start to its end."""

import contextlib
import gc
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

from cubestack.emulator.i2cdev import guest_process
from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.device_file import DeviceFile
from cubestack.emulator.i2cdev.device_node import DeviceNode
from cubestack.emulator.i2cdev.pacing import Watch, sharpen_timers
from cubestack.emulator.i2cdev.preload.shim import repeat_library, shim_library
from cubestack.emulator.i2cdev.remote import RemoteBus
from cubestack.emulator.i2cdev.scheduler import TURNAROUND_NS, open_scheduler
from cubestack.emulator.i2cdev.seccomp.supervisor import Files, Supervisor
from cubestack.emulator.i2cdev.server import I2cServer
from cubestack.emulator.native.compiler import CompilerError
from cubestack.emulator.ports.endpoint import Endpoint, PortError
from cubestack.emulator.sim.virtual_time import Kernel

IDLE_NS = 100_000_000

FORWARDED = (signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True)
class HostBus:
    """An I2C bus that programs reach through device files."""

    kernel: Kernel
    busy: Callable[[], bool]  # whether its devices have work without the host
    adapter: I2cAdapter | None  # the master of the bus; None if that is in another process
    port: Endpoint  # the port that a scheduler must serve
    files: Files  # opens a device file of the bus
    path: str  # path of its socket
    targets: Sequence[tuple[str, int]]  # name and address of each device


def emulated_bus(
    kernel: Kernel,
    busy: Callable[[], bool],
    adapter: I2cAdapter,
    path: Path,
    targets: Sequence[tuple[str, int]] = (),
) -> HostBus:
    """The bus of an emulation in this process; also serves it at ``path``. Raises PortError."""
    server = I2cServer(path, adapter, targets)
    files = partial(DeviceFile, adapter)
    return HostBus(kernel, busy, adapter, server, files, server.name, targets)


def attached_bus(path: Path) -> HostBus:
    """The bus that another process serves at ``path``; raises PortError."""
    remote = RemoteBus(path)
    try:
        targets = remote.greet()
    except PortError:
        remote.close()
        raise
    return HostBus(Kernel(), lambda: False, None, remote, remote.open, remote.name, targets)


def run_program(
    command: Sequence[str],
    number: int,
    bus: HostBus,
    *,
    pace: Literal["real", "fast"],
    route: guest_process.Route | None = None,
    streams: guest_process.Streams = guest_process.INHERITED,
    timeout_s: float | None = None,
    report: Callable[[str], None] = lambda _text: None,
) -> int:
    """Run ``command``, for which ``bus`` is /dev/i2c-``number``; returns its exit status.

    Without a ``route``, seccomp is tried, then preload; ``report`` gets the route and the reason.
    Processes that the program leaves behind are also served until they end.

    Raises:
        subprocess.TimeoutExpired: after ``timeout_s`` of wall time; the program is killed.
        RouteError: the route is not available.
        CompilerError: the library of the preload route can not be built.
    """
    with _forwarding() as begin:
        program, supervisor, reason = _start(command, number, bus, route, streams)
        run = begin(_Run(program, supervisor))
        report(f"/dev/i2c-{number} is served by {reason}")
        with _Limit(timeout_s, run) as limit:
            _serve(bus, run, pace=pace, report=report)
        if limit.reached:
            _ = program.exit_code  # waits: the program may end after its service
            raise subprocess.TimeoutExpired(list(command), timeout_s or 0.0)
    return program.exit_code


def run_beside(
    command: Sequence[str],
    kernel: Kernel,
    busy: Callable[[], bool],
    ports: Sequence[Endpoint],
    *,
    pace: Literal["real", "fast"],
    report: Callable[[str], None] = lambda _text: None,
) -> int:
    """Run ``command`` while ``ports`` are served; returns its exit status. Raises OSError."""
    with _forwarding() as begin:
        run = begin(_Run(guest_process.start_plain(command), None))
        with open_scheduler(
            kernel, [*ports, run, *run.ports], busy, pace=pace, report=report
        ) as scheduler:
            run.on_end = scheduler.stop
            scheduler.run()
        return run.exit_code


@contextlib.contextmanager
def _forwarding() -> Iterator[Callable[["_Run"], "_Run"]]:
    """Forward signals to the program that begins inside; closes its ports at the end."""
    running: list[_Run] = []
    early: list[int] = []

    def end(number: int, _frame: object) -> None:
        if running:
            running[0].signalled(number)
        else:
            early.append(number)  # the program may have started, but is not known yet

    def begin(run: _Run) -> _Run:
        running.append(run)
        for each in early:
            run.signalled(each)
        return run

    handlers = {number: signal.signal(number, end) for number in (*FORWARDED, signal.SIGINT)}
    try:
        yield begin
    finally:
        for signal_number, handler in handlers.items():
            signal.signal(signal_number, handler)
        for run in running:
            run.close()


def _serve(
    bus: HostBus, run: "_Run", *, pace: Literal["real", "fast"], report: Callable[[str], None]
) -> None:
    """Serve ``run`` until it ends; without a scheduler if the bus is in another process."""
    ports = [bus.port, *run.ports]
    if bus.adapter is None:
        sharpen_timers()
        watch = Watch(ports)
        while not run.ended:
            ready = watch.wait(TURNAROUND_NS, awake=True) or watch.wait(IDLE_NS)
            for port in ready or ports:
                port.exchange(0)
        watch.close()
        return
    with open_scheduler(
        bus.kernel,
        [run],
        bus.busy,
        pace=pace,
        i2c=bus.adapter,
        i2c_ports=ports,
        always_asleep=run.shares_processor,
        report=report,
    ) as scheduler:
        run.on_end = scheduler.stop
        gc.freeze()  # keeps collections between transfers short: the catalogue is large
        try:
            scheduler.run()
        finally:
            gc.unfreeze()


class _Run(Endpoint):
    """A running program; as a port of the scheduler, it notices the end.

    Attributes:
        ports: ports that must be served for it.
        on_end: called when no process is left.
    """

    def __init__(self, program: guest_process.GuestProcess, supervisor: Supervisor | None) -> None:
        self.name = program.name
        self.ports: list[Endpoint] = [supervisor, program] if supervisor else [program]
        self.on_end: Callable[[], None] = lambda: None
        self._program = program
        self._supervisor = supervisor
        self._dropped = False

    @property
    def ended(self) -> bool:
        """Whether no process is left that could call."""
        served = self._supervisor is not None and not self._supervisor.ended
        return self._dropped or (self._program.ended and not served)

    @property
    def exit_code(self) -> int:
        """Of the program, as in a shell."""
        return self._program.exit_code

    @property
    def shares_processor(self) -> bool:
        """Whether program and supervisor share a processor, so that calls arrive without delay.

        Busy-waiting would then only delay the program.
        """
        return self._supervisor is not None and self._supervisor.shares_processor

    def signalled(self, number: int) -> None:
        """Forward a signal; not Ctrl-C, which the terminal sends to the program as well."""
        if self._program.ended:
            self._dropped = True  # only orphans of the program were still served
        elif number != signal.SIGINT:
            self._program.send(number)

    def kill(self) -> None:
        """End the program, and serve none of its processes any more."""
        self._dropped = True
        with contextlib.suppress(ProcessLookupError):
            self._program.send(signal.SIGKILL)

    def exchange(self, now_ps: int) -> None:
        """Call ``on_end`` at the end; ``ports`` are served separately."""
        if self.ended:
            self.on_end()

    def close(self) -> None:
        for port in self.ports:
            port.close()


class _Limit:
    """Kills a program after a time.

    Attributes:
        reached: whether it was killed.
    """

    def __init__(self, timeout_s: float | None, run: _Run) -> None:
        self.reached = False
        self._run = run
        self._timer = None if timeout_s is None else threading.Timer(timeout_s, self._kill)

    def _kill(self) -> None:
        self.reached = True
        self._run.kill()

    def __enter__(self) -> "_Limit":
        if self._timer:
            self._timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._timer:
            self._timer.cancel()
            self._timer.join()


def _start(
    command: Sequence[str],
    number: int,
    bus: HostBus,
    route: guest_process.Route | None,
    streams: guest_process.Streams,
) -> tuple[guest_process.GuestProcess, Supervisor | None, str]:
    """Start the program: it, its supervisor or None, and the route with its reason."""
    environment = guest_process.bus_environment(number, bus.path)
    refused = ""
    if route != "preload":
        try:
            repeating, limit = _repeating()
            program, supervisor = guest_process.start_filtered(
                command, environment | repeating, DeviceNode(number), bus.files, streams
            )
        except guest_process.RouteError as error:
            if route == "seccomp":
                raise guest_process.RouteError(f"seccomp: {error}; try --route preload") from None
            refused = f", as seccomp is not available: {error}"
        else:
            reason = "as requested" if route else "which works with any program"
            return program, supervisor, f"seccomp, {reason}{limit}"
    try:
        program = guest_process.start_preloaded(command, environment, shim_library(), streams)
    except guest_process.RouteError as error:
        raise guest_process.RouteError(f"preload: {error}{refused}") from None
    return program, None, f"preload{refused or ', as requested'}"


def _repeating() -> tuple[dict[str, str], str]:
    """Environment variables that load the repeating library; else none, and the reason."""
    try:
        return guest_process.preload_environment(repeat_library()), ""
    except (CompilerError, guest_process.RouteError) as error:
        return {}, f"; a signal can end a call with EINTR ({error})"
