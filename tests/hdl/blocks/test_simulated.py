"""Blocks that any sensor may use, each alone, on Icarus Verilog."""

from typing import Any

import pytest

from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.blocks.frames import FrameReader, FrameWriter
from tests.tiers import quick

SMALL = [(5, 3), (8, 4)]
BLOCKS = {
    "frame_reader": (FrameReader, SMALL),
    "frame_writer": (FrameWriter, SMALL),
    "matrix_counter": (MatrixCounter, [(2, 2), *SMALL]),
}
CASES = [(name, *size) for name, (_, sizes) in BLOCKS.items() for size in sizes]


@pytest.mark.parametrize("seed", quick([1, 2], 1))
@pytest.mark.parametrize(("name", "columns", "rows"), quick(CASES, 3))
def test_block(icarus: Any, name: str, columns: int, rows: int, seed: int) -> None:
    block, _ = BLOCKS[name]
    icarus.run(block, columns, rows, f"tests.hdl.blocks.testbenches.{name}", seed=seed)
