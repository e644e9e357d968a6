"""Functional coverage: points are declared, noted by any process, and missed loudly."""

import os
import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest

from cubestack.firmware_model.interface.cubesense.fpga import COMMANDS, Action
from tests.hdl.coverage import points
from tests.hdl.coverage.points import GROUPS, row_of, states_of

HERE = Path(__file__).parent
BOARD = "PublishedTestbench"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HDL_COVERAGE", str(tmp_path))
    points.COVERAGE.forget()
    return tmp_path


def test_merged_coverage_lists_only_missed_points(folder: Path) -> None:
    everything = [(name, point) for name, group in GROUPS.items() for point in group.points()]
    assert points.missed(points.merged(folder)) == everything
    for _ in range(2):
        points.hit("pressure", testbench=BOARD, pressure="steady")
    (file,) = folder.iterdir()
    (folder / "other.txt").write_text(f"pressure\t{BOARD}\tslow processor\n", encoding="utf-8")
    found = points.merged(folder)
    assert found["pressure"] == {(BOARD, "steady"), (BOARD, "slow processor")}
    assert len(points.missed(found)) == len(everything) - 2
    assert len(file.read_text(encoding="utf-8").splitlines()) == 1
    lines = list(points.table(found, most=3))
    assert len(lines) == len(GROUPS) + 4
    assert lines[-1] == f"not reached: {len(everything) - 5} more"


def test_rejects_undeclared_points(folder: Path) -> None:
    with pytest.raises(ValueError, match=f"{BOARD} / idle is no declared point of 'pressure'"):
        points.hit("pressure", testbench=BOARD, pressure="idle")
    with pytest.raises(ValueError, match="has testbench, pressure, not testbench"):
        points.hit("pressure", testbench=BOARD)


def test_every_row_of_the_table_is_declared() -> None:
    """And every action of each side in every state."""
    rows = {point[1] for point in GROUPS["pair command"].points() if point[0] == "pair"}
    levels = product((0, 1), repeat=5)
    assert rows == {row_of(*row, mcu_addressing=False) for row in levels} - {"xxx11"}
    assert len([row for row in COMMANDS if row.sunen + row.naden < 2]) == len(COMMANDS) - 1
    taken = {tuple(point[1:]) for point in GROUPS["pair state"].points()}
    for side, action in product(("sun", "nadir"), Action):
        for state in set(states_of(side, action)) - {"before a line"}:
            assert (side, str(action), state) in taken


def test_documentation_lists_every_coverage_group() -> None:
    text = (HERE.parents[2] / "docs" / "gateware-tests.md").read_text(encoding="utf-8")
    for name, group in GROUPS.items():
        assert f"| {name} | {len(group.points())} | {group.meaning} |" in text


@pytest.mark.slow
def test_regression_that_misses_a_point_fails(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [*command, str(HERE.parent / "blocks" / "test_blocks.py"), "-k", "counter_address_width"],
        env={**os.environ, "HDL_COVERAGE": str(tmp_path / "points")},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert "passed" in done.stdout
    assert "not reached: cubestar command" in done.stdout
    assert done.returncode == 1
