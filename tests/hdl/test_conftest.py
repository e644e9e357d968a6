"""A failing simulation fails pytest, whatever else may break, and leaves a waveform."""

import json
from pathlib import Path
from typing import Any

import pytest

from cubestack.hdl.blocks.matrix_counter import MatrixCounter

FAILING = ["fails", "fails_in_the_background"]


@pytest.fixture
def failing(icarus: Any, tmp_path: Path) -> Any:
    """Keeps its waveforms apart from those that somebody looks at."""
    return type(icarus)(tmp_path, tmp_path / "waves")


def test_failing_cocotb_tests_are_named(failing: Any, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=r"failed: \['fails', 'fails_in_the_background'\]"):
        failing.run(MatrixCounter, 2, 2, "tests.hdl.harness.failing", seed=1)
    (waveform,) = (tmp_path / "waves").glob("*.vcd")
    assert waveform.stem == "conftest.failing_cocotb_tests_are_named.fails"
    assert "$enddefinitions" in waveform.read_text(encoding="utf-8")
    about = json.loads(waveform.with_suffix(".json").read_text(encoding="utf-8"))
    assert about["cocotb"] == "fails"
    assert "as it should" in about["error"]


def test_waveform_goes_when_the_test_passes_again(failing: Any, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="waveform"):
        failing.run(MatrixCounter, 2, 2, "tests.hdl.harness.failing", seed=1)
    failing.run(MatrixCounter, 2, 2, "tests.hdl.blocks.testbenches.matrix_counter", seed=1)
    assert not list((tmp_path / "waves").iterdir())


def test_module_that_cannot_be_loaded_fails(failing: Any) -> None:
    with pytest.raises((AssertionError, RuntimeError)):
        failing.run(MatrixCounter, 2, 2, "tests.hdl.harness.missing", seed=1)
