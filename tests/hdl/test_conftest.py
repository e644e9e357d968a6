"""A failing simulation fails pytest, whatever else may break."""

from typing import Any

import pytest

from cubestack.hdl.matrix_counter import MatrixCounter


def test_failing_cocotb_tests_are_named(icarus: Any) -> None:
    with pytest.raises(AssertionError, match=r"failed: \['fails', 'fails_in_the_background'\]"):
        icarus.run(MatrixCounter, 2, 2, "benches_failing", seed=1)


def test_module_that_cannot_be_loaded_fails(icarus: Any) -> None:
    with pytest.raises((AssertionError, RuntimeError)):
        icarus.run(MatrixCounter, 2, 2, "benches_missing", seed=1)
