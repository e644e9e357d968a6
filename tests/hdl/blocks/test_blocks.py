"""Blocks that any sensor may use, each alone, on Icarus Verilog; impossible ones are refused."""

import gc
from collections.abc import Callable
from typing import Any

import pytest
from amaranth.lib.wiring import Component

from cubestack.hdl.blocks.bus_port import BusPort
from cubestack.hdl.blocks.counters import GrayCounter, MatrixCounter
from cubestack.hdl.blocks.frames import FrameGap, FrameReader, FrameWriter
from tests.hdl.regression import FULL
from tests.tiers import quick

SMALL = [(5, 3), (8, 4)]
BLOCKS = {
    "frame_reader": (FrameReader, SMALL),
    "frame_writer": (FrameWriter, SMALL),
    "matrix_counter": (MatrixCounter, [(2, 2), *SMALL]),
}
CASES = [(name, *size) for name, (_, sizes) in BLOCKS.items() for size in sizes]


@pytest.mark.parametrize("seed", (1, 2) if FULL else (1,))
@pytest.mark.parametrize(("name", "columns", "rows"), quick(CASES, 1))
def test_block_passes_its_testbench_in_icarus(
    icarus: Any, name: str, columns: int, rows: int, seed: int
) -> None:
    block, _ = BLOCKS[name]
    icarus.run(block, columns, rows, f"tests.hdl.blocks.testbenches.{name}", seed=seed)


@pytest.mark.parametrize(
    ("columns", "rows", "bits"), [(2, 2, 2), (5, 3, 5), (8, 4, 5), (640, 480, 19), (1024, 512, 19)]
)
def test_matrix_counter_address_width_fits_columns_and_rows(
    columns: int, rows: int, bits: int
) -> None:
    assert MatrixCounter.address_width(columns, rows) == bits


@pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: MatrixCounter(1, 4), "columns must be at least 2"),
        (lambda: MatrixCounter(8, 0), "rows must be at least 2"),
        (lambda: BusPort(0), "address_width must be in 1..24, not 0"),
        (lambda: BusPort(25), "address_width must be in 1..24, not 25"),
        (lambda: FrameGap(0), "clocks must be at least 1, not 0"),
        (lambda: GrayCounter(3), "positions must be at least 4, not 3"),
    ],
)
def test_rejects_impossible_designs(make: Callable[[], Component], error: str) -> None:
    with pytest.raises(ValueError, match=error):
        make()
    gc.collect(1)  # what was refused is never elaborated; have Amaranth say so here
