"""A debugged machine stands while anybody holds virtual time."""

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
