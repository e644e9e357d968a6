"""The pair of FPGAs on its pins, on Icarus Verilog."""

import random
from typing import Any

import pytest
from regression import FULL, SMALLEST

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.hdl.cubesense.pair import CubeSensePair

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
    simulate(CubeSensePair, SMALLEST, *modules, seed=seed, initialised=False)


def addressable(read_out: ReadOut) -> CubeSensePair:
    """The pair with address control from the microcontroller."""
    return CubeSensePair(read_out, mcu_addressing=True)


@pytest.mark.parametrize("seed", [1, 2])
def test_addressing(
    simulate: Any, read_out: ReadOut, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MCU_ADDRESSING", "1")
    simulate(addressable, read_out, "benches_pair_addressing", seed=seed)


def test_addressing_at_full_size(simulate: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MCU_ADDRESSING", "1")
    simulate(addressable, FULL_SIZE, "benches_pair_addressing", seed=1)


@pytest.mark.parametrize("initialised", [True, False])
def test_addressing_changes_nothing_else(
    simulate: Any, initialised: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MCU_ADDRESSING", "1")
    simulate(addressable, SMALLEST, *MODULES, seed=1, initialised=initialised)


@pytest.mark.skipif(not FULL, reason="`make test-hdl` runs it")
@pytest.mark.parametrize("addressing", [False, True], ids=["published", "addressing"])
def test_every_state_and_border(
    simulate: Any, addressing: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MCU_ADDRESSING", str(int(addressing)))
    design = addressable if addressing else CubeSensePair
    simulate(design, SMALLEST, "benches_pair_states", seed=1)


def test_full_size(simulate: Any) -> None:
    simulate(CubeSensePair, FULL_SIZE, "benches_full_size", seed=1, harness="cubesense_full_frame")
