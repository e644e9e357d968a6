"""Runs cocotb modules of this folder on the pair, with the test harness of tests/hdl."""

import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from amaranth.lib.wiring import Component

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut

# Folders in which this process and the simulated Python find their modules.
sys.path += [str(Path(__file__).parents[n]) for n in (0, 2, 3)]

from tests.hdl.conftest import icarus, pytest_collection_modifyitems

__all__ = ["icarus", "pytest_collection_modifyitems", "simulate"]


@pytest.fixture
def simulate(icarus: Any) -> Callable[..., None]:
    """``simulate(read_out, *modules, seed=…)``: cocotb ``modules`` on the pair.

    Without initial values, as the part has none: RESET_N alone makes the state. (Icarus would not
    compute what follows from an initial value that no reset changes.)
    """
    from cubesense_fpga_i2c.pair import CubeSenseI2cPair

    def run(read_out: ReadOut, *modules: str, **options: Any) -> None:
        def i2c_pair(columns: int, rows: int) -> Component:
            assert (columns, rows) == (read_out.columns, read_out.rows)
            return CubeSenseI2cPair(read_out)

        environment = {"READ_OUT": json.dumps(asdict(read_out))}
        options |= {"initialised": False, "environment": environment}
        icarus.run(i2c_pair, read_out.columns, read_out.rows, *modules, **options)

    return run
