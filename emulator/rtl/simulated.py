"""The reference engine: the design in Amaranth's own simulator, the SRAM in Python."""

from typing import Any

from amaranth.sim import Simulator

from cubestack.emulator.rtl.sram import SramTiming
from cubestack.emulator.rtl.stepped import SteppedEngine
from cubestack.emulator.rtl.wiring import Wiring


class SimulatedEngine(SteppedEngine):
    """Runs some ten thousand clocks per second; it has no access to registers of the design."""

    def __init__(
        self, wiring: Wiring, sram_timing: SramTiming | None = None, *, skipping: bool = True
    ) -> None:
        super().__init__(wiring, sram_timing, skipping=skipping)
        contexts: list[Any] = []

        async def lend_context(context: Any) -> None:
            contexts.append(context)

        simulator = Simulator(wiring.component)
        simulator.add_testbench(lend_context)
        simulator.advance()
        # The simulator's own time stays 0; each set() of its context settles the design.
        self._context = contexts[0]
        self._settle(0)

    def close(self) -> None: ...

    def _get(self, name: str) -> int:
        return int(self._context.get(getattr(self.wiring.component, name)))

    def _put(self, name: str, value: int) -> None:
        self._context.set(getattr(self.wiring.component, name), value)
