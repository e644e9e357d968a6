"""Functions of a loaded program, called from outside, and the cycles that they take.

For measuring compiled code: the program has no main, each call begins and ends at the machine's
present state. Arguments follow the Procedure Call Standard for the Arm Architecture (IHI 0042):
integers and addresses in r0 to r3.
"""

import struct
from collections.abc import Callable, Iterable, Mapping
from io import BytesIO

from elftools.elf.elffile import ELFFile
from elftools.elf.sections import SymbolTableSection

from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import StopReason

LONGEST_PS = 100_000_000_000_000
"""A call that takes longer than 100 s is an error."""

THUMB_STATE = 1 << 24


class CallError(RuntimeError):
    """A call did not return."""


def symbols_of(image: Image) -> dict[str, int]:
    """Address of each function and variable by name; of an image made of an ELF file."""
    if image.elf is None:
        raise ValueError("functions have names in ELF files only")
    table = ELFFile(BytesIO(image.elf)).get_section_by_name(".symtab")
    if not isinstance(table, SymbolTableSection):
        return {}
    return {
        symbol.name: symbol["st_value"] & (~1 if symbol["st_info"]["type"] == "STT_FUNC" else ~0)
        for symbol in table.iter_symbols()
        if symbol.name
    }


class Calls:
    """Calls functions of one program.

    Attributes:
        symbols: addresses by name.
    """

    def __init__(
        self, machine: Machine, image: Image, returned: str = "returned", failed: str = "failed"
    ) -> None:
        """Load the program and run its start up to function ``returned``, where calls end too.

        Faults lead to function ``failed``.
        """
        self.machine, self.symbols = machine, symbols_of(image)
        self._end = self.symbols[returned]
        machine.load(image)
        machine.reset()
        for address in (self._end, self.symbols[failed]):
            machine.breakpoints.add(address)
        self._run({})
        self._stack = machine.register("sp")

    def call(
        self,
        name: str,
        *arguments: int,
        marks: Mapping[str, Callable[[int, int], None]] | None = None,
    ) -> int:
        """Call a function; returns the cycles until it is back.

        ``marks``: functions by name, each with what to tell when it is entered: its first argument,
        and the cycles since the start of the machine.
        """
        machine = self.machine
        for number, argument in enumerate(arguments):
            machine.set_register(f"r{number}", argument)
        machine.set_register("sp", self._stack)
        machine.set_register("lr", self._end | 1)
        machine.set_register("xpsr", THUMB_STATE)
        machine.set_register("pc", self.symbols[name])
        before = machine.cycles
        self._run({self.symbols[mark]: tell for mark, tell in (marks or {}).items()})
        return machine.cycles - before

    def floats(self, name: str, count: int) -> tuple[float, ...]:
        """Single-precision values of a variable."""
        return struct.unpack(f"<{count}f", self.machine.peek(self.symbols[name], 4 * count))

    def put(self, name: str, data: bytes) -> None:
        """Write a variable."""
        self.machine.poke(self.symbols[name], data)

    def _run(self, marks: Mapping[int, Callable[[int, int], None]]) -> None:
        machine = self.machine
        _add(machine, marks)
        try:
            while True:
                stop = machine.run(machine.now_ps + LONGEST_PS)
                place = machine.register("pc")
                if stop.reason is StopReason.OUTBOX:
                    list(machine.outbox())
                elif stop.reason is not StopReason.BREAKPOINT:
                    raise CallError(f"{stop.reason.name.lower()} at {place:#x} ends a call")
                elif place == self._end:
                    return
                elif place in marks:
                    marks[place](machine.register("r0"), machine.cycles)
                else:
                    raise CallError("a call ends with a fault")
        finally:
            for address in marks:
                machine.breakpoints.discard(address)


def _add(machine: Machine, addresses: Iterable[int]) -> None:
    for address in addresses:
        machine.breakpoints.add(address)
