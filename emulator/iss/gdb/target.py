"""The target of a debugger's session, and its XML description and memory map for GDB.

GDB manual, appendices "Target Descriptions" and "Memory Map Format".
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, Protocol

SIGINT, SIGILL, SIGTRAP, SIGBUS, SIGSEGV = 2, 4, 5, 10, 11
"""Signals by GDB's own numbers (include/gdb/signals.def)."""

CORE = (*(f"r{number}" for number in range(13)), "sp", "lr", "pc")
XPSR_NUMBER = 25
"""GDB's number of the status register; 16 to 24 belonged to the FPA coprocessor."""

SYSTEM = ("msp", "psp", "primask", "basepri", "faultmask", "control")

REGISTERS = dict(enumerate(CORE)) | dict(enumerate(("xpsr", *SYSTEM), start=XPSR_NUMBER))
"""Names by number, in the order of the packet that carries all registers."""

TYPES = {"sp": "data_ptr", "pc": "code_ptr", "msp": "data_ptr", "psp": "data_ptr"}

WatchKind = Literal["write", "read", "access"]


@dataclass(frozen=True)
class Stop:
    """Why the target is halted."""

    signal: int = SIGTRAP  #: one of the above
    watch: tuple[WatchKind, int] | None = None  #: kind and address of the watchpoint that was hit
    breakpoint: bool = False  #: whether it halted at a breakpoint


@dataclass(frozen=True)
class MemoryRegion:
    """A region of the memory map."""

    #: flash is written by the protocol's flash commands, as by ``load``
    kind: Literal["ram", "rom", "flash"]
    start: int  #: first address
    length: int  #: in bytes
    block: int = 0  #: size of an erase block of flash, in bytes


class DebugTarget(Protocol):
    """A processor and its memories. All but ``halted`` and ``halt`` require that it is halted."""

    @property
    def registers(self) -> dict[int, str]:
        """Names of its registers by the numbers of the description."""

    @property
    def regions(self) -> tuple[MemoryRegion, ...]: ...

    @property
    def halted(self) -> Stop | None:
        """Why it is halted; None while it runs."""

    def attach(self) -> None: ...

    def detach(self) -> None:
        """Remove all breakpoints and watchpoints, and run: the client has gone."""

    def halt(self) -> None:
        """Halt before the next instruction."""

    def resume(self) -> None: ...

    def step(self, low: int, high: int) -> None:
        """Run one instruction, or more while the next one is in ``low``..``high`` - 1."""

    def register(self, name: str) -> int: ...

    def set_register(self, name: str, value: int) -> None: ...

    def read(self, address: int, count: int) -> bytes:
        """Read memory without side effects; fewer bytes at the end of a memory."""

    def write(self, address: int, data: bytes) -> bool:
        """Write memory, flash too; False if it cannot be written."""

    def set_breakpoint(self, address: int, on: bool) -> None:
        """Halt before the instruction there."""

    def set_watchpoint(self, address: int, count: int, kind: WatchKind, on: bool) -> None:
        """Halt before an instruction that accesses these bytes; the next step executes it.

        GDB expects this of ARM: it steps, and shows the value before and after.
        """

    def restart(self) -> None:
        """Reset, and halt before the first instruction."""

    def monitor(self, command: str) -> str:
        """Output of a ``monitor`` command; ValueError if it is invalid."""


def _features() -> str:
    """Features org.gnu.gdb.arm.m-profile and m-system."""

    def described(names: Iterable[str]) -> str:
        return "".join(
            f'<reg name="{name}" bitsize="32" regnum="{number}" type="{TYPES.get(name, "int")}"/>'
            for number, name in REGISTERS.items()
            if name in names
        )

    return (
        f'<feature name="org.gnu.gdb.arm.m-profile">{described((*CORE, "xpsr"))}</feature>'
        f'<feature name="org.gnu.gdb.arm.m-system">{described(SYSTEM)}</feature>'
    )


TARGET_XML = (
    '<?xml version="1.0"?><!DOCTYPE target SYSTEM "gdb-target.dtd">'
    f"<target><architecture>arm</architecture>{_features()}</target>"
)


def memory_map(regions: Iterable[MemoryRegion]) -> str:
    lines = []
    for region in regions:
        head = f'<memory type="{region.kind}" start="{region.start:#x}" length="{region.length:#x}"'
        if region.kind == "flash":
            lines.append(f'{head}><property name="blocksize">{region.block:#x}</property></memory>')
        else:
            lines.append(f"{head}/>")
    return (
        '<?xml version="1.0"?><!DOCTYPE memory-map PUBLIC "+//IDN gnu.org//DTD GDB Memory Map V1.0'
        '//EN" "http://sourceware.org/gdb/gdb-memory-map.dtd">'
        f"<memory-map>{''.join(lines)}</memory-map>"
    )
