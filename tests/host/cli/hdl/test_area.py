import json

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
