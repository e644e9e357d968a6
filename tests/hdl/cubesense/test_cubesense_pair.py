"""The pair of FPGAs on its pins, on Icarus Verilog."""

import random
from typing import Any

import pytest

from cubestack.firmware_model.interface.cubesense_fpga import FULL_SIZE, ReadOut
from cubestack.hdl.cubesense_pair import CubeSensePair

MODULES = ["benches_pair_store", "benches_pair_read", "benches_pair_modes", "benches_pair_failures"]


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("module", MODULES)
def test_pair(simulate: Any, read_out: ReadOut, module: str, seed: int) -> None:
    simulate(CubeSensePair, read_out, module, seed=seed)


@pytest.mark.parametrize("seed", [1, 2])
def test_needs_no_initial_values(simulate: Any, seed: int) -> None:
    """Standby alone makes the state: the parts' flip-flops come up as they like."""
    modules = MODULES.copy()
    random.Random(seed).shuffle(modules)
    read_out = ReadOut(11, 5, 9, scan_step=2, first_row=1, first_column=1, window=5, window_left=1)
    simulate(CubeSensePair, read_out, *modules, seed=seed, initialised=False)


def test_full_size(simulate: Any) -> None:
    simulate(CubeSensePair, FULL_SIZE, "benches_full_size", seed=1, harness="cubesense_full_frame")
