import gc
from typing import Any

import pytest

from cubestack.hdl.blocks.matrix_counter import MatrixCounter


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(("columns", "rows"), [(2, 2), (5, 3), (8, 4)])
def test_on_icarus(icarus: Any, columns: int, rows: int, seed: int) -> None:
    icarus.run(MatrixCounter, columns, rows, "benches_matrix_counter", seed=seed)


@pytest.mark.parametrize(
    ("columns", "rows", "bits"), [(2, 2, 2), (5, 3, 5), (8, 4, 5), (640, 480, 19), (1024, 512, 19)]
)
def test_address_width(columns: int, rows: int, bits: int) -> None:
    assert MatrixCounter.address_width(columns, rows) == bits


@pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
@pytest.mark.parametrize(("columns", "rows", "name"), [(1, 4, "columns"), (8, 0, "rows")])
def test_refuses_a_frame_without_room(columns: int, rows: int, name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be at least 2"):
        MatrixCounter(columns, rows)
    gc.collect()  # what was refused is never elaborated; have Amaranth say so here
