"""Whole frames on the compiled engine and on Icarus Verilog.

Random commands are compared in tests/hdl/engines, test_equivalence and test_equivalence_pair.
"""

import shutil
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.top import CubeStarTop
from tests.tiers import quick

from .cameras import ListCamera, plain_camera
from .commanded import Command, CommandedIcarus, Outcome, run_engine
from .pair_board import STROBE_PERIOD, Script, readings

pytestmark = pytest.mark.skipif(
    shutil.which("iverilog") is None, reason="Icarus Verilog (iverilog) is not installed"
)


class Star(NamedTuple):
    wiring: Wiring
    icarus: CommandedIcarus
    camera: ListCamera

    def outcome(self, commands: list[Command]) -> Outcome:
        cameras = {self.wiring.cameras[0].name: self.camera}
        engine = make_engine(self.wiring, "compiled")
        compiled = run_engine(engine, cameras, commands, STROBE_PERIOD)
        assert compiled == self.icarus.run(cameras, commands)["ACK"]
        return compiled


def star(folder: Path, top: CubeStarTop, camera: ListCamera) -> Star:
    wiring = cubestar_wiring(top)
    return Star(wiring, CommandedIcarus(folder, wiring, STROBE_PERIOD), camera)


@pytest.mark.parametrize("bank", quick([0, 1], 1))
def test_icarus_stores_small_frames_enabled_at_any_clock(bank, tmp_path):
    """ENABLE rises in one clock after the other of the first frame and its blanking."""
    top = CubeStarTop(5, 3)
    camera = plain_camera(5, 3, period=Fraction(10**12, 11_000_000), frames=3, blank=5)
    capture_ps = camera.end_ps
    board = star(tmp_path, top, camera)
    for clock in range(0, 32, 3):
        enable_ps = int((clock + Fraction(1, 3)) * camera.period)
        commands = [
            (1, "BANK", bank),
            (enable_ps, "ENABLE", 1),
            (capture_ps, "RNW", 1),
            (capture_ps + 50_000, "strobe", 40),
            (capture_ps + 50_000 + 40 * STROBE_PERIOD, "ENABLE", 0),
        ]
        assert len(board.outcome(commands).acks) == 1


@pytest.mark.slow
def test_full_frame_store_and_read_matches_icarus(tmp_path):
    """1024 x 512 pixels of 1322 clocks a line at 10 MHz, stored and read back to the last byte."""
    top = CubeStarTop()
    camera = plain_camera(1024, 512, frames=1, line_clocks=1322, blank=40)
    size = top.columns * top.rows
    read_ps = camera.end_ps + 50_000
    commands = [
        (777, "ENABLE", 1),
        (camera.end_ps, "RNW", 1),
        (read_ps, "strobe", size),
        (read_ps + size * STROBE_PERIOD, "ENABLE", 0),
    ]
    assert star(tmp_path, top, camera).outcome(commands).data == camera.images[0].tobytes()


@pytest.mark.slow
@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_one_full_frame_of_the_pair(tmp_path):
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
