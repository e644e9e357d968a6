import json
from pathlib import Path

import pytest

from cubestack.hdl.cubesense import tops as cubesense
from cubestack.hdl.cubestar import tops as cubestar
from cubestack.hdl.flow.area_report import recorded_areas

from ....conftest import Run


def test_area_as_text(run: Run) -> None:
    lines = run("hdl", "area", "cubestar", "frame gap").out.splitlines()
    assert "of 768" in lines[0]
    assert [line[:10] for line in lines[1:]] == ["cubestar  ", "frame gap "]


def test_area_as_json(run: Run) -> None:
    outcome = run("hdl", "area", "--json", "frame gap of 858 clocks", "cubestar")
    counted = json.loads(outcome.out)["designs"]
    recorded = recorded_areas(cubestar.AREA_FILE) | recorded_areas(cubesense.AREA_FILE)
    assert list(counted) == ["frame gap of 858 clocks", "cubestar"]
    for name, entry in counted.items():
        assert entry == {key: recorded[name][key] for key in entry}
        assert "ice40" not in entry


def test_area_of_a_users_design_is_that_of_the_shipped_one_it_equals(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "same.py").write_text("from cubestack.hdl.cubestar.top import CubeStarTop as Same")
    monkeypatch.chdir(tmp_path)
    outcome = run("hdl", "area", "--json", "same:Same", "--device", "cubestar")
    (found,) = json.loads(outcome.out)["designs"].values()
    shipped = recorded_areas(cubestar.AREA_FILE)["cubestar"]
    assert found == {key: shipped[key] for key in found}
