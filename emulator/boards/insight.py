"""What a board that runs firmware of the user's own can tell of it: profile, coverage, history."""

from functools import cached_property

from cubestack.emulator.iss.insight.history import History
from cubestack.emulator.iss.insight.observer import Observer
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine
from cubestack.firmware_model.interface.efm32gg import LAYOUTS


class Insight:
    """Looks at a machine from the first use on; until then the machine runs at full speed.

    Attributes:
        machine: it.
    """

    def __init__(self, machine: Machine) -> None:
        """Look at ``machine``, which is loaded."""
        self.machine = machine
        self._observed = False

    @cached_property
    def symbols(self) -> Symbols:
        """Names of the program."""
        return Symbols.of(self.machine.image)

    @cached_property
    def observer(self) -> Observer:
        """Counts cycles, executions and calls."""
        self._observed = True
        return Observer(self.machine, self.symbols)

    @cached_property
    def history(self) -> History:
        """Takes note of each function and exception; who wants it must take what it finds."""
        interrupts = {
            number: name
            for layout in LAYOUTS
            for instance in layout.instances
            for name, number in instance.interrupts.items()
        }
        return History(self.observer, interrupts)

    def close(self) -> None:
        """Look no longer; what was counted stays."""
        if self._observed:
            self.observer.close()
