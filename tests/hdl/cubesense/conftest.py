"""Runs cocotb modules of this folder on CubeSense's designs."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
from amaranth.lib.wiring import Component

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut

HERE = Path(__file__).parent

#: Small pictures: no power of two; powers of two; and a window as large as the picture is high.
SMALL = (
    ReadOut(21, 13, 11, scan_step=4, first_row=1, first_column=3, window=7, window_left=2),
    ReadOut(16, 8, 7, scan_step=4, first_row=0, first_column=2, window=5, window_above=1),
    ReadOut(11, 5, 9, scan_step=2, first_row=1, first_column=1, window=5, window_left=1),
)


@pytest.fixture(params=SMALL, ids=lambda size: f"{size.columns}x{size.rows}")
def read_out(request: pytest.FixtureRequest) -> ReadOut:
    return request.param


@pytest.fixture
def simulate(icarus: Any, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """``simulate(make, read_out, *modules, seed=…)``: cocotb ``modules`` on ``make(read_out)``."""

    def run(
        make: Callable[[ReadOut], Component],
        read_out: ReadOut,
        *modules: str,
        name: str = "",
        **options: Any,
    ) -> None:
        def design(columns: int, rows: int) -> Component:
            assert (columns, rows) == (read_out.columns, read_out.rows)
            return make(read_out)

        design.__name__ = name or getattr(make, "__name__", "")
        monkeypatch.syspath_prepend(HERE)
        monkeypatch.setenv("READ_OUT", json.dumps(asdict(read_out)))
        icarus.run(design, read_out.columns, read_out.rows, *modules, **options)

    return run
