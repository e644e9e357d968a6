"""What a debugger's session acts on."""

from dataclasses import dataclass
from typing import Literal, Protocol

SIGINT, SIGILL, SIGTRAP, SIGBUS, SIGSEGV = 2, 4, 5, 10, 11
"""Signals by the numbers of GDB (include/gdb/signals.def), which are no system's."""

WatchKind = Literal["write", "read", "access"]


@dataclass(frozen=True)
class Stop:
    """Why the target stands.

    Attributes:
        signal: one of the above.
        watch: kind and address of the watchpoint that was hit.
        breakpoint: whether it stands at a breakpoint.
    """

    signal: int = SIGTRAP
    watch: tuple[WatchKind, int] | None = None
    breakpoint: bool = False


@dataclass(frozen=True)
class MemoryRegion:
    """A line of the memory map.

    Attributes:
        kind: flash is written by the flash commands of the protocol, so by ``load``.
        start: first address.
        length: in bytes.
        block: bytes that are erased together, of flash.
    """

    kind: Literal["ram", "rom", "flash"]
    start: int
    length: int
    block: int = 0


class Target(Protocol):
    """A processor with its memories. All but ``halted`` and ``halt`` are used while it stands."""

    @property
    def registers(self) -> dict[int, str]:
        """Names of its registers by number, as the description numbers them."""

    @property
    def regions(self) -> tuple[MemoryRegion, ...]:
        """Its memory map."""

    @property
    def halted(self) -> Stop | None:
        """Why it stands; None while it runs."""

    def attach(self) -> None:
        """A client has come: halt."""

    def detach(self) -> None:
        """The client has gone: remove all breakpoints and watchpoints, and run."""

    def halt(self) -> None:
        """Stand before the next instruction."""

    def resume(self) -> None:
        """Run."""

    def step(self, low: int, high: int) -> None:
        """Run one instruction, and on while the next one is in ``low``..``high`` - 1."""

    def register(self, name: str) -> int:
        """Value of a register."""

    def set_register(self, name: str, value: int) -> None:
        """Change a register."""

    def read(self, address: int, count: int) -> bytes:
        """Bytes of memory without side effects, as many as there are from ``address`` on."""

    def write(self, address: int, data: bytes) -> bool:
        """Change memory, flash too; False where nothing can be written."""

    def set_breakpoint(self, address: int, on: bool) -> None:
        """Stand before the instruction there."""

    def set_watchpoint(self, address: int, count: int, kind: WatchKind, on: bool) -> None:
        """Stand after an access to these bytes."""

    def restart(self) -> None:
        """Reset, and stand before the first instruction."""

    def monitor(self, command: str) -> str:
        """What a ``monitor`` command answers; ValueError for one that makes no sense."""
