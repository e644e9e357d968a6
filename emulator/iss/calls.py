"""Calls functions of a loaded program and measures their cycles.

The program needs no main; each call starts from the machine's present state. Arguments follow the
Procedure Call Standard for the Arm Architecture (IHI 0042): integers and addresses in r0 to r3.
"""

import struct
from collections.abc import Callable, Mapping

from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import StopReason

LONGEST_PS = 100_000_000_000_000
"""Time-out of a call: 100 s."""

THUMB_STATE = 1 << 24


class CallError(RuntimeError):
    """A call did not return."""


class Calls:
    """Calls functions of one program.

    Attributes:
        symbols: addresses by name.
    """

    def __init__(
        self, machine: Machine, image: Image, returned: str = "returned", failed: str = "failed"
    ) -> None:
        """Load the program and run its start-up code to function ``returned``, where calls end too.

        Faults end in function ``failed``. Raises ValueError if the image is not from an ELF file.
        """
        if image.elf is None:
            raise ValueError("only ELF files contain function names")
        self.machine, self.symbols = machine, Symbols.of(image).labels
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
        """Call a function; returns the cycles until it returns.

        ``marks``: callbacks by function name, called at each entry with the function's first
        argument and the machine's cycles. Raises CallError.
        """
        machine = self.machine
        for number, argument in enumerate(arguments):
            machine.set_register(f"r{number}", argument)
        machine.set_register("sp", self._stack)
        machine.set_register("lr", self._end | 1)
        machine.set_register("xpsr", THUMB_STATE)
        machine.set_register("pc", self.symbols[name])
        before = machine.cycles
        self._run({self.symbols[name]: call for name, call in (marks or {}).items()})
        return machine.cycles - before

    def floats(self, name: str, count: int) -> tuple[float, ...]:
        """Read a variable as single-precision values."""
        return struct.unpack(f"<{count}f", self.machine.peek(self.symbols[name], 4 * count))

    def put(self, name: str, data: bytes) -> None:
        self.machine.poke(self.symbols[name], data)

    def _run(self, marks: Mapping[int, Callable[[int, int], None]]) -> None:
        machine = self.machine
        machine.breakpoints |= set(marks)
        end_ps = machine.now_ps + LONGEST_PS
        try:
            while True:
                stop = machine.run(end_ps)
                place = machine.register("pc")
                if stop.sends:
                    list(machine.outbox())
                if stop.reason is StopReason.OUTBOX or (
                    stop.reason is StopReason.TIME and stop.now_ps < end_ps
                ):
                    continue
                if stop.reason is not StopReason.BREAKPOINT:
                    raise CallError(f"the call ended at {place:#x}: {stop.reason.name.lower()}")
                elif place == self._end:
                    return
                elif place in marks:
                    marks[place](machine.register("r0"), machine.cycles)
                else:
                    raise CallError("the call ended with a fault")
        finally:
            machine.breakpoints -= set(marks)
