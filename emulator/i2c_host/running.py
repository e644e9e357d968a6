"""A program with an emulated bus: where the bus comes from, by which route, until it ends."""

import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cubestack.emulator.i2c_host.adapter import I2cAdapter
from cubestack.emulator.i2c_host.device_file import DeviceFile
from cubestack.emulator.i2c_host.device_node import DeviceNode
from cubestack.emulator.i2c_host.pacing import sharpen_timers, wait_precisely
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
from cubestack.emulator.ports.pump import Pump
from cubestack.emulator.virtual_time import Kernel

__all__ = ["HostBus", "attached_bus", "emulated_bus", "run_program"]

FORWARDED = (signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True)
class HostBus:
    """A bus for programs.

    Attributes:
        kernel: what to drive.
        busy: whether it has work.
        port: to serve with the pump.
        files: opens a device file of it.
        path: of the socket that serves it.
    """

    kernel: Kernel
    busy: Callable[[], bool]
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
        server := I2cServer(path, adapter),
        lambda: DeviceFile(adapter),
        server.name,
    )


def attached_bus(path: Path) -> HostBus:
    """The bus that another process serves at ``path``; raises PortError."""
    remote = RemoteBus(path)
    return HostBus(Kernel(), lambda: False, remote, remote.open, remote.name)


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
    program, supervisor, reason = _start(command, number, bus, route)
    ports: list[Endpoint] = [bus.port, program, *([supervisor] if supervisor else [])]
    pump = Pump(bus.kernel, ports, bus.busy, pace=pace, report=say, wait=wait_precisely)
    watch = _Watch(pump, program, supervisor)
    ports.append(watch)
    say(f"/dev/i2c-{number} by way of {reason}")
    sharpen_timers()
    handlers = {number: signal.getsignal(number) for number in (*FORWARDED, signal.SIGINT)}
    try:
        for number in FORWARDED:
            signal.signal(number, lambda number, _frame: program.send(number))
        # The terminal sends it to the program as well, and that one decides.
        signal.signal(signal.SIGINT, lambda _number, _frame: pump.stop() if program.ended else None)
        pump.run()
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        program.close()
        if supervisor:
            supervisor.close()
    return program.exit_code


class _Watch:
    """A port that stops the pump when there is nobody left to serve."""

    name = "end"
    congested = False

    def __init__(self, pump: Pump, program: Program, supervisor: Supervisor | None) -> None:
        self._pump = pump
        self._program = program
        self._supervisor = supervisor

    def exchange(self, now_ps: int) -> None:
        if self._program.ended and (self._supervisor is None or self._supervisor.ended):
            self._pump.stop()

    def watched(self) -> list[tuple[int, int]]:
        return []

    def release_ps(self, count: int) -> int | None:
        return None

    def close(self) -> None:
        pass


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
                raise RouteError(f"--route seccomp: {error}; try --route preload") from None
            refused = f", as seccomp is not there: {error}"
        else:
            asked = "as asked" if route else "which any program can take"
            return program, supervisor, f"seccomp, {asked}"
    library = shim_library()
    program = start_preloaded(command, environment, library)
    return program, None, f"preload{refused or ', as asked'}"
