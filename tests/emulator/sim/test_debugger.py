import pytest

from cubestack.emulator.iss.outcome import Stop, StopReason
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.sim.debugger import Debugger
from cubestack.emulator.sim.virtual_time import Kernel

from ..iss.efm32gg.bench import LOOP, MS, Bench

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

CODE = 0x100
BKPT, MOVS_R1_5, MOVS_R1_6, UNDEFINED = 0xBE00, 0x2105, 0x2106, 0xDE00


@pytest.mark.parametrize("attached", [False, True])
def test_machine_stops_while_the_kernel_is_held(attached: bool) -> None:
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


@pytest.fixture
def debugger() -> Debugger:
    """Attached to a program of two BKPT, a MOVS behind each."""
    bench = Bench()
    debugger = Debugger(Kernel(), bench.machine, bench.reset, ())
    program = (BKPT, MOVS_R1_5, BKPT, MOVS_R1_6, LOOP)
    debugger.attach()
    debugger.write(CODE, b"".join(half.to_bytes(2, "little") for half in program))
    return debugger


def run_on(debugger: Debugger) -> tuple[int, int, bool]:
    """Where it is a millisecond after it was let go at the latest, R1, and whether it stands."""
    debugger.resume()
    debugger.run(debugger.machine.now_ps + MS)
    return debugger.register("pc"), debugger.register("r1"), debugger.halted is not None


def test_program_breakpoint_stops_once(debugger: Debugger) -> None:
    debugger.set_register("r1", 0)
    debugger.set_register("pc", CODE)
    assert run_on(debugger) == (CODE, 0, True)
    assert run_on(debugger) == (CODE + 4, 5, True)
    assert run_on(debugger) == (CODE + 8, 6, False)


def test_step_at_a_breakpoint_instruction_executes_it_alone(debugger: Debugger) -> None:
    debugger.set_register("pc", CODE)
    run_on(debugger)
    debugger.set_register("r1", 0)
    for after, value in ((CODE + 2, 0), (CODE + 4, 5)):
        debugger.step(0, 0)
        debugger.run(debugger.machine.now_ps + MS)
        assert (debugger.register("pc"), debugger.register("r1")) == (after, value)
    assert debugger.halted is not None


def test_continues_from_the_address_set_by_the_debugger(debugger: Debugger) -> None:
    debugger.set_register("pc", CODE)
    run_on(debugger)
    debugger.set_register("pc", CODE + 6)
    assert run_on(debugger) == (CODE + 8, 6, False)


def test_a_caught_fault_stops_at_its_handler_s_first_instruction() -> None:
    bench = Bench(MOVS_R1_5, LOOP)  # of every vector
    debugger = Debugger(Kernel(), bench.machine, bench.reset, ())
    debugger.attach()
    debugger.monitor("catch on")
    debugger.write(CODE + 0x100, UNDEFINED.to_bytes(2, "little"))
    debugger.set_register("r1", 0)
    debugger.set_register("pc", CODE + 0x100)
    assert run_on(debugger) == (CODE, 0, True)
