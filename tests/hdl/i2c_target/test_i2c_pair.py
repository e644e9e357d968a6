"""The pair on its I2C bus, against an independent master, on Icarus Verilog."""

from typing import Any

import pytest

from cubestack.firmware_model.interface.cubesense_fpga import FULL_SIZE, ReadOut

SMALLEST = ReadOut(11, 5, 9, scan_step=2, first_row=1, first_column=1, window=5, window_left=1)
SIZES = (SMALLEST, ReadOut(16, 8, 7, scan_step=4, first_row=0, first_column=2, window=5))


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size.columns}x{size.rows}")
@pytest.mark.parametrize("module", ["benches_i2c_registers", "benches_i2c_store"])
def test_pair(simulate: Any, size: ReadOut, module: str) -> None:
    simulate(size, module, seed=1)


def test_full_size(simulate: Any) -> None:
    simulate(FULL_SIZE, "benches_i2c_full_size", seed=1)
