"""The pair of FPGAs on its pins, on Icarus Verilog."""

import random
from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.hdl.cubesense.pair import CubeSensePair
from tests.hdl.regression import SMALLEST, addressable
from tests.tiers import quick

NAMES = ["modes", "read", "store", "failures"]
SEEDS = quick([1, 2], 1)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", NAMES)
def test_pair(simulate: Any, read_out: ReadOut, name: str, seed: int) -> None:
    simulate(CubeSensePair, read_out, name, seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_needs_no_initial_values(simulate: Any, seed: int) -> None:
    """Standby alone sets the state: the parts' flip-flops power up at any level."""
    names = NAMES.copy()
    random.Random(seed).shuffle(names)
    simulate(CubeSensePair, SMALLEST, *names, seed=seed, initialised=False)


@pytest.mark.parametrize("seed", SEEDS)
def test_addressing(simulate: Any, read_out: ReadOut, seed: int) -> None:
    simulate(addressable, read_out, "addressing", mcu_addressing=True, seed=seed)


@pytest.mark.slow
def test_addressing_at_full_size(simulate: Any) -> None:
    simulate(addressable, FULL_SIZE, "addressing", mcu_addressing=True, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("initialised", quick([False, True], 1))
def test_addressing_changes_nothing_else(simulate: Any, initialised: bool) -> None:
    options = {"mcu_addressing": True, "initialised": initialised}
    simulate(addressable, SMALLEST, *NAMES, seed=1, **options)


@pytest.mark.slow
def test_full_size(simulate: Any) -> None:
    harness = Path(__file__).with_name("cubesense_full_frame.v")
    simulate(CubeSensePair, FULL_SIZE, "full_size", seed=1, harness=harness)
