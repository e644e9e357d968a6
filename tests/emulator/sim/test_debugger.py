"""A debugged machine: it stands while time is held, and at its program's own breakpoints."""

from typing import Any

import pytest

from cubestack.emulator.iss.machine import Stop, StopReason
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.sim.debugger import Debugger
from cubestack.emulator.sim.virtual_time import Kernel

from ..iss.efm32gg.bench import MS, Bench


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
@pytest.mark.parametrize("attached", [False, True])
def test_a_machine_stands_where_it_is_while_the_kernel_is_held(attached: bool) -> None:
    bench, kernel = Bench(), Kernel()
    debugger = Debugger(kernel, bench.machine, bench.reset, ())
    if attached:
        debugger.attach()
        debugger.resume()
    standing_ps = bench.now
    kernel.hold("somebody")
    assert debugger.run(standing_ps + MS) == Stop(StopReason.TIME, standing_ps)
    assert bench.now == standing_ps
    kernel.release("somebody")
    assert debugger.run(standing_ps + MS).now_ps >= standing_ps + MS


class Halting:
    """A machine whose every instruction is two bytes long; it stands at those that are BKPT."""

    asleep = False
    now_ps = 0

    def __init__(self, *breakpoints: int) -> None:
        self._own = breakpoints
        self.breakpoints = set[int]()
        self.pc = 0x100

    def attach_debugger(self, attached: bool, catches: int = 0) -> None: ...

    def register(self, _name: str) -> int:
        return self.pc

    def set_register(self, _name: str, value: int) -> None:
        self.pc = value

    def run(self, _until_ps: int) -> Stop:
        for _ in range(8):
            if self.pc in self._own:
                return Stop(StopReason.HALTED, 0)
            self.pc += 2
        return Stop(StopReason.TIME, 0)

    def step(self, _until_ps: int, _within: tuple[int, int]) -> Stop:
        if self.pc in self._own:
            return Stop(StopReason.HALTED, 0)
        self.pc += 2
        return Stop(StopReason.STEPPED, 0)


@pytest.fixture
def debugger() -> Debugger:
    """At the first breakpoint of a program that has another one behind it."""
    machine: Any = Halting(0x104, 0x10A)
    debugger = Debugger(Kernel(), machine, lambda: None, ())
    debugger.attach()
    assert run_on(debugger) == (0x104, True)
    return debugger


def run_on(debugger: Debugger) -> tuple[int, bool]:
    """Where it is after it was let go, and whether it stands."""
    debugger.resume()
    debugger.run(1)
    return debugger.register("pc"), debugger.halted is not None


def test_each_breakpoint_of_the_program_stops_it_once(debugger: Debugger) -> None:
    assert debugger.kernel.paused
    assert run_on(debugger) == (0x10A, True)
    assert run_on(debugger) == (0x10C + 16, False)
    assert not debugger.kernel.paused


def test_a_step_at_a_breakpoint_of_the_program_is_the_one_behind_it(debugger: Debugger) -> None:
    debugger.step(0, 0)
    debugger.run(1)
    assert (debugger.register("pc"), debugger.halted is not None) == (0x108, True)


@pytest.mark.parametrize("chosen", [0x102, 0x106])
def test_from_a_place_that_the_debugger_has_chosen_it_goes_on_there(
    debugger: Debugger, chosen: int
) -> None:
    debugger.set_register("pc", chosen)
    debugger.resume()
    assert debugger.register("pc") == chosen
