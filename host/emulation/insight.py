"""Profile and coverage files of the user's firmware, and the debugger port."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.emulation.records import create_file

if TYPE_CHECKING:
    from cubestack.emulator.iss.insight.observer import Observer
    from cubestack.emulator.ports.gdb import GdbEndpoint


@dataclass(frozen=True)
class InsightFiles:
    """Paths of the files to write; None for no file."""

    profile: Path | None = None
    coverage: Path | None = None

    def open(self, stack: ExitStack) -> Callable[[AnyEmulated], None]:
        """Open the files; ``stack`` writes them for each device passed to the returned function.

        Raises ValueError for a file that cannot be written.
        """
        from cubestack.emulator.iss.insight.reports import write_callgrind, write_lcov

        observers: list[Observer] = []
        outputs: list[tuple[IO[str], Any]] = [
            (create_file(path, stack), write)
            for path, write in ((self.profile, write_callgrind), (self.coverage, write_lcov))
            if path is not None
        ]

        def watch(emulated: AnyEmulated) -> None:
            observers.append(own_firmware(emulated, "--profile-out and --coverage-out").observer)

        def write_all() -> None:
            if observers:
                first, *others = observers
                for other in others:
                    first.add(other)
                for stream, write in outputs:
                    write(first, stream)

        if outputs:
            stack.callback(write_all)
            return watch
        return lambda _emulated: None


def own_firmware(emulated: AnyEmulated, what: str) -> Any:
    """The insight into a device's own firmware; raises ValueError if it runs none."""
    insight = emulated.board.insight
    if insight is None:
        name = emulated.device.name
        raise ValueError(f"{what}: {name} runs no own firmware; add --firmware")
    return insight


def open_gdb(emulated: AnyEmulated, port: int, *, wait: bool) -> GdbEndpoint:
    """Serve gdb for a device's own firmware on a local TCP port.

    Raises ValueError if it runs none, PortError if the port is not available.
    """
    from cubestack.emulator.boards.debugging import open_debugger

    own_firmware(emulated, "--gdb")
    board: Any = emulated.board
    endpoint = open_debugger(board, port, wait=wait)
    emulated.board.on_close.append(endpoint.close)
    return endpoint
