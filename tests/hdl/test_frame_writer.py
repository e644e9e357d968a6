from typing import Any

import pytest

from cubestack.hdl.blocks.frame_writer import FrameWriter


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(("columns", "rows"), [(5, 3), (8, 4)])
def test_on_icarus(icarus: Any, columns: int, rows: int, seed: int) -> None:
    icarus.run(FrameWriter, columns, rows, "benches_frame_writer", seed=seed)
