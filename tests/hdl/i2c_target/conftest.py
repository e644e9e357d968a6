"""Runs cocotb modules of this folder on CubeSense's pair with an I2C bus."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from amaranth.lib.wiring import Component

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut
from cubestack.hdl.cubesense.i2c.pair import CubeSenseI2cPair

HERE = Path(__file__).parent


@pytest.fixture
def simulate(icarus: Any, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """``simulate(read_out, *modules, seed=…)``: cocotb ``modules`` on the pair.

    Without initial values, as the part has none: RESET_N alone makes the state. (Icarus would not
    compute what follows from an initial value that no reset changes.)
    """

    def run(read_out: ReadOut, *modules: str, **options: Any) -> None:
        def i2c_pair(columns: int, rows: int) -> Component:
            assert (columns, rows) == (read_out.columns, read_out.rows)
            return CubeSenseI2cPair(read_out)

        for folder in (HERE.parent / "cubesense", HERE):
            monkeypatch.syspath_prepend(folder)
        monkeypatch.setenv("READ_OUT", json.dumps(asdict(read_out)))
        icarus.run(
            i2c_pair, read_out.columns, read_out.rows, *modules, initialised=False, **options
        )

    return run
