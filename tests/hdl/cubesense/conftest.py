"""Runs cocotb modules of this folder on CubeSense's designs."""

from collections.abc import Callable
from typing import Any

import pytest
from amaranth.lib.wiring import Component

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut
from tests.hdl.regression import PAIR, modules, pair_environment
from tests.tiers import quick

#: Small pictures: no power of two; powers of two; and a window as large as the picture is high.
SMALL = (
    ReadOut(21, 13, 11, scan_step=4, first_row=1, first_column=3, window=7, window_left=2),
    ReadOut(16, 8, 7, scan_step=4, first_row=0, first_column=2, window=5, window_above=1),
    ReadOut(11, 5, 9, scan_step=2, first_row=1, first_column=1, window=5, window_left=1),
)


@pytest.fixture(params=quick(reversed(SMALL), 1), ids=lambda size: f"{size.columns}x{size.rows}")
def read_out(request: pytest.FixtureRequest) -> ReadOut:
    return request.param


@pytest.fixture
def simulate(icarus: Any) -> Callable[..., None]:
    """``simulate(make, read_out, *names, seed=…)``: testbenches of this folder on a design.

    ``make(read_out)`` makes it, with address control if the modules are to know of that
    (``mcu_addressing``); ``side`` is that of one FPGA alone.
    """

    def run(
        make: Callable[[ReadOut], Component],
        read_out: ReadOut,
        *names: str,
        name: str = "",
        mcu_addressing: bool = False,
        side: str = "",
        **options: Any,
    ) -> None:
        def design(columns: int, rows: int) -> Component:
            assert (columns, rows) == (read_out.columns, read_out.rows)
            return make(read_out)

        design.__name__ = name or make.__name__
        environment = {**pair_environment(read_out, mcu_addressing), "SIDE": side}
        size = read_out.columns, read_out.rows
        icarus.run(design, *size, *modules(PAIR, *names), environment=environment, **options)

    return run
