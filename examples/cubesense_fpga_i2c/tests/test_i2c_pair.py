"""The pair on its I2C bus, against an independent master, on Icarus Verilog."""

import os
from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut

HERE = Path(__file__).parent

SMALL = {
    "benches_i2c_registers": ReadOut(
        11, 5, 9, scan_step=2, first_row=1, first_column=1, window=5, window_left=1
    ),
    "benches_i2c_store": ReadOut(16, 8, 7, scan_step=4, first_row=0, first_column=2, window=5),
}


@pytest.mark.slow
@pytest.mark.parametrize("module", SMALL)
def test_i2c_pair_passes_its_testbenches(simulate: Any, module: str) -> None:
    simulate(SMALL[module], module, seed=1)


def test_i2c_pair_passes_its_testbenches_at_full_size(simulate: Any) -> None:
    simulate(FULL_SIZE, "benches_i2c_full_size", "benches_i2c_times", seed=1)


@pytest.mark.skipif("I2C_WHOLE" not in os.environ, reason="takes a minute: set I2C_WHOLE")
def test_whole_i2c_read_outs_pass_their_testbench(simulate: Any) -> None:
    simulate(FULL_SIZE, "benches_i2c_whole", seed=1, harness=HERE / "i2c_full_frame.v")
