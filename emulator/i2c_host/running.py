"""A program with an emulated bus: where the bus comes from, by which route, until it ends."""

import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cubestack.emulator.i2c_host.adapter import I2cAdapter
from cubestack.emulator.i2c_host.device_file import DeviceFile
from cubestack.emulator.i2c_host.device_node import DeviceNode
from cubestack.emulator.i2c_host.pacing import sharpen_timers, wait_precisely, wait_until
from cubestack.emulator.i2c_host.program import (
    Program,
    Route,
    RouteError,
    bus_environment,
    start_filtered,
    start_preloaded,
)
from cubestack.emulator.i2c_host.remote import RemoteBus
from cubestack.emulator.i2c_host.server import I2cServer
from cubestack.emulator.i2c_host.shim import shim_library
from cubestack.emulator.i2c_host.supervisor import Files, Supervisor
from cubestack.emulator.ports.endpoint import Endpoint
from cubestack.emulator.ports.pump import SLICE_S, Pump
from cubestack.emulator.virtual_time import PS_PER_MS, Kernel

__all__ = ["HostBus", "attached_bus", "emulated_bus", "run_program"]

AHEAD_PS = 2 * PS_PER_MS
"""How far virtual time may be ahead of wall time during a transfer, when it is paced."""

TURNAROUND_NS = 200_000
"""A call that comes so soon after the last answer starts where that transfer ended: what it takes
to get from one process to the other is not counted."""

IDLE_NS = 100_000_000
PS_PER_NS = 1000
NS_PER_S = 10**9

FORWARDED = (signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True)
class HostBus:
    """A bus for programs.

    Attributes:
        kernel: what to drive.
        busy: whether it has work.
        adapter: its master; None when that is in another process.
        port: to serve with the pump.
        files: opens a device file of it.
        path: of the socket that serves it.
    """

    kernel: Kernel
    busy: Callable[[], bool]
    adapter: I2cAdapter | None
    port: Endpoint
    files: Files
    path: str


def emulated_bus(
    kernel: Kernel, busy: Callable[[], bool], adapter: I2cAdapter, path: Path
) -> HostBus:
    """The bus of an emulation in this process, served at ``path`` as well; raises PortError."""
    return HostBus(
        kernel,
        lambda: adapter.busy or busy(),
        adapter,
        server := I2cServer(path, adapter),
        lambda: DeviceFile(adapter),
        server.name,
    )


def attached_bus(path: Path) -> HostBus:
    """The bus that another process serves at ``path``; raises PortError."""
    remote = RemoteBus(path)
    return HostBus(Kernel(), lambda: False, None, remote, remote.open, remote.name)


def run_program(
    command: Sequence[str],
    number: int,
    bus: HostBus,
    *,
    pace: Literal["real", "fast"],
    route: Route | None = None,
    say: Callable[[str], None] = lambda _text: None,
) -> int:
    """Run ``command``, for which ``bus`` is /dev/i2c-``number``; returns its exit code.

    Without a ``route``, seccomp is tried, then preload; ``say`` gets which one and why. Processes
    that the program leaves behind are served until they end as well.

    Raises:
        RouteError: the kernel refuses the route.
        CompilerError: the library of the preload route can not be built.
    """
    running: list[_Ports] = []
    early: list[int] = []

    def end(number: int, _frame: object) -> None:
        if running:
            running[0].signalled(number)
        else:
            early.append(number)  # perhaps the program runs, and we do not know it yet

    handlers = {number: signal.signal(number, end) for number in (*FORWARDED, signal.SIGINT)}
    try:
        program, supervisor, reason = _start(command, number, bus, route)
        ports = _Ports(bus, program, supervisor, fast=pace == "fast")
        running.append(ports)
        for each in early:
            ports.signalled(each)
        say(f"/dev/i2c-{number} by way of {reason}")
        sharpen_timers()
        if bus.adapter is None:
            ports.serve()
        else:
            pump = Pump(
                bus.kernel,
                [ports],
                bus.busy,
                pace=pace,
                report=say,
                clock_ns=ports.clock_ns,
                wait=wait_precisely,
            )
            ports.on_end = pump.stop
            pump.run()
    finally:
        for signal_number, handler in handlers.items():
            signal.signal(signal_number, handler)
        for ports in running:
            ports.close()
    return program.exit_code


class _Ports:
    """All ports as one, which does transfers in one go where the pump would look at each byte.

    Paced, virtual time runs ahead of wall time for that, and the program is told when wall time
    gets there.

    Attributes:
        on_end: called when there is nobody left to serve.
    """

    name = "program and bus"
    congested = False

    def __init__(
        self, bus: HostBus, program: Program, supervisor: Supervisor | None, *, fast: bool
    ) -> None:
        self.on_end: Callable[[], None] = lambda: None
        self._bus = bus
        self._program = program
        self._supervisor = supervisor
        self._fast = fast
        self._ended = False
        others: list[Endpoint] = [supervisor] if supervisor else []
        self._ports: list[Endpoint] = [bus.port, program, *others]
        self._origin_ns = time.monotonic_ns() - bus.kernel.now // PS_PER_NS
        if bus.adapter is not None:
            bus.adapter.holding = not fast

    def clock_ns(self) -> int:
        """Wall time, on the scale of virtual time when that is paced."""
        return time.monotonic_ns() - self._origin_ns

    def exchange(self, now_ps: int) -> None:
        for port in self._ports:
            port.exchange(now_ps)
        adapter = self._bus.adapter
        if adapter is not None:
            told = adapter.told
            self._transfer(adapter)
            if adapter.told > told:
                self._await_next(adapter)
        if self._program.ended and (self._supervisor is None or self._supervisor.ended):
            self._end()

    def serve(self) -> None:
        """Serve without a pump: the bus is in another process."""
        while not self._ended:
            wait_until(self.watched(), IDLE_NS)
            self.exchange(0)

    def signalled(self, number: int) -> None:
        """Pass a signal on, but for Ctrl-C: that comes to the program as well, and it decides."""
        if self._program.ended:
            self._end()  # only what the program left behind was still served
        elif number != signal.SIGINT:
            self._program.send(number)

    def _end(self) -> None:
        self._ended = True
        self.on_end()

    def _transfer(self, adapter: I2cAdapter) -> None:
        kernel = self._bus.kernel
        end_ns = time.monotonic_ns() + int(SLICE_S * NS_PER_S)
        limit_ps = None if self._fast else self.clock_ns() * PS_PER_NS + AHEAD_PS
        while adapter.busy and time.monotonic_ns() < end_ns:
            if limit_ps is not None and (kernel.horizon() or 0) > limit_ps:
                break
            kernel.step()
        while kernel.horizon() == kernel.now:  # what is left of them
            kernel.step()
        if adapter.holding:
            adapter.release(self.clock_ns() * PS_PER_NS)

    def _await_next(self, adapter: I2cAdapter) -> None:
        """Virtual time stands still for a moment: most programs call again at once."""
        end_ns = time.monotonic_ns() + TURNAROUND_NS
        while not adapter.busy and (left_ns := end_ns - time.monotonic_ns()) > 0:
            wait_until(self.watched(), left_ns)
            for port in self._ports:
                port.exchange(self._bus.kernel.now)
        self._transfer(adapter)

    def watched(self) -> list[tuple[int, int]]:
        return [item for port in self._ports for item in port.watched()]

    def release_ps(self, count: int) -> int | None:
        return None if self._bus.adapter is None else self._bus.adapter.release_ps()

    def close(self) -> None:
        """Release program and supervisor; the bus is the caller's."""
        self._program.close()
        if self._supervisor is not None:
            self._supervisor.close()


def _start(
    command: Sequence[str], number: int, bus: HostBus, route: Route | None
) -> tuple[Program, Supervisor | None, str]:
    """The program, its supervisor if it has one, and the route with the reason for it."""
    environment = bus_environment(number, bus.path)
    refused = ""
    if route != "preload":
        try:
            program, supervisor = start_filtered(
                command, environment, DeviceNode(number), bus.files
            )
        except RouteError as error:
            if route == "seccomp":
                raise RouteError(f"seccomp: {error}; try --route preload") from None
            refused = f", as seccomp is not there: {error}"
        else:
            asked = "as asked" if route else "which any program can take"
            return program, supervisor, f"seccomp, {asked}"
    try:
        program = start_preloaded(command, environment, shim_library())
    except RouteError as error:
        raise RouteError(f"preload: {error}{refused}") from None
    return program, None, f"preload{refused or ', as asked'}"
