import json
import math
from pathlib import Path

import pytest

from cubestack.host.studies.rows import record
from cubestack.host.studies.rows.estimate import Estimate
from cubestack.host.studies.rows.record import Measurement, load, measurement, save

FIGURES = {"rate": Estimate(94.0, 90.5, 96.25), "count": 405.0, "lost": math.nan}


@pytest.fixture
def digests(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    known = {"a.py": "11", "b.py:X,Y": "22", "c.cpp": "33"}
    monkeypatch.setattr(record, "digest", known.__getitem__)
    return known


def test_stored_measurements_are_read_back(tmp_path: Path, digests: dict[str, str]) -> None:
    some = {
        "sky, published": measurement("f(seed=1)", 12.34, FIGURES, ["a.py", "c.cpp"]),
        "sky, extended": measurement("f(seed=1)", 1.0, {"v": 0.1}, ["a.py", "b.py:X,Y"]),
    }
    path = tmp_path / "data" / "x.json"
    save(path, some)
    back = load(path)
    assert back.keys() == some.keys()
    one = back["sky, published"]
    assert (one.call, one.seconds, one.depends) == ("f(seed=1)", 12.3, ("a.py 11", "c.cpp 33"))
    rate = one.figures["rate"]
    assert isinstance(rate, Estimate)
    assert (rate, rate.low, rate.high) == (94.0, 90.5, 96.25)
    assert math.isnan(one.figures["lost"])
    once = path.read_text()
    save(path, back)
    assert path.read_text() == once
    assert len(json.loads(once)["depends"]) == 3


def test_measurement_names_the_files_that_changed(digests: dict[str, str]) -> None:
    one = measurement("f", 1.0, {}, ["a.py", "b.py:X,Y", "c.cpp"])
    assert one.changed == []
    digests["b.py:X,Y"] = "23"
    assert one.changed == ["b.py"]
    digests["c.cpp"] = ""
    assert one.changed == ["b.py", "c.cpp"]


def test_measurements_of_other_versions_of_a_file_keep_theirs(
    tmp_path: Path, digests: dict[str, str]
) -> None:
    path, old = tmp_path / "x.json", measurement("f", 1.0, {}, ["a.py"])
    digests["a.py"] = "12"
    save(path, {"old": old, "new": measurement("f", 1.0, {}, ["a.py"])})
    back = load(path)
    assert (back["old"].changed, back["new"].changed) == (["a.py"], [])


def test_file_of_another_kind_has_no_measurements(tmp_path: Path) -> None:
    path = tmp_path / "ratios.json"
    path.write_text('{"0.2.0": {"ratio": 2.1}}', "utf-8")
    assert load(path) == {}


def test_file_that_is_not_there_has_no_measurements(tmp_path: Path) -> None:
    assert load(tmp_path / "none.json") == dict[str, Measurement]()
