"""CubeSense's pair: a full frame on the compiled engine and on Icarus Verilog.

Random commands are compared in tests/hdl/engines and in test_equivalence_pair.
"""

import shutil
from fractions import Fraction

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.factory import make_engine
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.hdl.cubesense.pair import CubeSensePair

from .cameras import ListCamera
from .commanded import CommandedIcarus, run_engine
from .pair_board import STROBE_PERIOD, Script, readings

pytestmark = [
    pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus Verilog is not installed"),
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
]


@pytest.mark.slow
def test_one_full_frame(tmp_path):
    """858 clocks a line at 13.5 MHz: the sun's picture across the link, then scan and window."""
    period, line_clocks = Fraction(10**12, 13_500_000), 858
    rng = np.random.default_rng(1)
    camera = ListCamera(period, line_clocks, FULL_SIZE.columns)
    image = rng.integers(0, 200, (FULL_SIZE.rows, FULL_SIZE.columns), dtype=np.uint8)
    image[400, 300:303] = 255
    camera.add_blank(FULL_SIZE.frame_gap + 20)
    camera.add_image(image)
    camera.add_blank(5)
    script = Script(rng)
    script.command(1, 0, 0, 0, 0)
    script.wait(camera.end_ps)
    for levels, count in readings("nadir", FULL_SIZE)[1:]:
        script.command(*levels)
        script.read(count)
    script.standby()
    wiring = cubesense_wiring(CubeSensePair())
    engine = make_engine(wiring, "compiled")
    compiled = run_engine(engine, {"sun": camera}, script.commands, STROBE_PERIOD, "NADACK")
    assert not engine.violations
    icarus = CommandedIcarus(tmp_path, wiring, STROBE_PERIOD)
    assert compiled == icarus.run({"sun": camera}, script.commands)["NADACK"]
    stored = np.frombuffer(compiled.memories["nadir"], np.uint8).reshape(512, 1024)
    assert (stored[: FULL_SIZE.rows, : FULL_SIZE.columns] == image).all()
    assert len(compiled.acks) == 1
    window = compiled.data[-4 - FULL_SIZE.window**2 :]
    assert window[:4] == bytes([300 % 256, 300 // 256, 400 % 256, 400 // 256])
