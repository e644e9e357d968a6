"""Pseudo-terminals for the serial lines of devices, and their paths in a program's words."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Protocol

from cubestack.emulator.boards.contract import Board
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.host.devices.device import AnyDevice

PORT = "{port}"
"""In a program's words: the path of the first device's terminal."""


class Powered(Protocol):
    """A powered-up device."""

    @property
    def device(self) -> AnyDevice: ...

    @property
    def board(self) -> Board: ...


class Terminals:
    """The terminals of some devices.

    Attributes:
        endpoints: to be served, by device.
        paths: of the first line of each device, by its name; a further line has a suffix.
    """

    def __init__(
        self,
        devices: Sequence[Powered],
        folder: Path,
        stack: ExitStack,
        *,
        strict: bool = False,
        report: Callable[[str], None] = lambda _text: None,
    ) -> None:
        """Open them in ``folder``; ``stack`` closes them. Raises PortError."""
        self.endpoints: list[list[PtyEndpoint]] = []
        self._devices = devices
        self.paths: dict[str, Path] = {}
        for opened in devices:
            path = folder / f"tty{opened.device.title.upper()}"
            self.paths.setdefault(opened.device.name, path)
            self.endpoints.append([])
            for line in opened.board.lines:
                place = path.with_name(path.name + line.suffix)
                endpoint = PtyEndpoint(place, line.uart, strict=strict, report=report)
                stack.callback(endpoint.close)
                self.endpoints[-1].append(endpoint)

    def by_kernel(self) -> list[tuple[Kernel, list[PtyEndpoint], Callable[[], bool]]]:
        """Per virtual time: its kernel, terminals, and whether its devices have work."""
        kernels = {id(one.board.kernel): one.board.kernel for one in self._devices}
        found: list[tuple[Kernel, list[PtyEndpoint], Callable[[], bool]]] = []
        for kernel in kernels.values():
            boards = [one.board for one in self._devices if one.board.kernel is kernel]
            ends = [
                end
                for one, ends in zip(self._devices, self.endpoints, strict=True)
                for end in ends
                if one.board.kernel is kernel
            ]
            found.append((kernel, ends, partial(_any_busy, boards)))
        return found

    def fill_in(self, words: Sequence[str]) -> list[str]:
        """``words`` with paths for ``PORT``, and for the name of a device in braces."""
        places = {"{" + name + "}": str(path) for name, path in self.paths.items()}
        places[PORT] = str(next(iter(self.paths.values())))
        filled = []
        for word in words:
            for place, path in places.items():
                word = word.replace(place, path)
            filled.append(word)
        return filled


def _any_busy(boards: Sequence[Board]) -> bool:
    return any(board.busy() for board in boards)
