"""Analysis of a user's own firmware on a board: profile, coverage, history."""

from functools import cached_property

from cubestack.emulator.iss.insight.observer import History, Observer
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine
from cubestack.firmware_model.interface.efm32gg import LAYOUTS


class Insight:
    """Observes a loaded machine from the first use on; until then it runs at full speed."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self._observed = False

    @cached_property
    def symbols(self) -> Symbols:
        return Symbols.of(self.machine.image)

    @cached_property
    def observer(self) -> Observer:
        """Counts cycles, executions and calls."""
        self._observed = True
        return Observer(self.machine, self.symbols)

    @cached_property
    def history(self) -> History:
        """Records each function and exception; the caller must call ``take`` regularly."""
        interrupts = {
            number: name
            for layout in LAYOUTS
            for instance in layout.instances
            for name, number in instance.interrupts.items()
        }
        return History(self.observer, interrupts)

    def close(self) -> None:
        if self._observed:
            self.observer.close()
