import json
from collections.abc import Iterator

import pytest

from tests.benchmarks.engines import speeds
from tests.benchmarks.engines.__main__ import main
from tests.benchmarks.engines.speeds import ENGINES, Speed
from tests.benchmarks.engines.workloads import WORKLOADS, WrongPictureError

RATES = {"compiled": 45e6, "verilator": 15e6, "cocotb": 30e3, "amaranth": 900.0}


@pytest.fixture
def figures(monkeypatch):
    """Replaces the measurement; engines in ``missing`` are absent."""

    def use(missing: dict[str, str], broken: str = "") -> None:
        def measure(top: str) -> Iterator[Speed]:
            if top == broken:
                raise WrongPictureError("SRAM has 1 at row 0, column 0, where the camera sent 2")
            return (Speed(top, name, RATES[name]) for name in ENGINES if name not in missing)

        monkeypatch.setattr(speeds, "absent", lambda: missing)
        monkeypatch.setattr(speeds, "prepare", lambda top: None)
        monkeypatch.setattr(speeds, "measure", measure)

    return use


def test_table_has_each_top_and_engine_with_its_ratio(figures, capsys):
    figures({})
    assert main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    for top in WORKLOADS:
        (line,) = [line for line in lines if line.split()[:1] == [top]]
        assert line.split("  ")[-1].strip().endswith("900 x 50,000")
        assert "45.0 M" in line
        assert "15.0 M x 3.0" in line
        assert "30.0 k x 1,500" in line


def test_json_names_absent_engines(figures, capsys):
    figures({"verilator": "Verilator"})
    assert main(["--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["absent"] == {"verilator": "Verilator"}
    assert {*report["clocks_per_s"]} == {*WORKLOADS}
    assert report["clocks_per_s"]["cubestar"] == {
        name: rate for name, rate in RATES.items() if name != "verilator"
    }
    assert report["ratio"]["cubestar"] == {"cocotb": 1500.0, "amaranth": 50000.0}


def test_absent_engines_are_named_below_the_table(figures, capsys):
    figures({"compiled": "a C++ compiler", "verilator": "a C++ compiler"})
    assert main([]) == 0
    captured = capsys.readouterr()
    assert "30.0 k" in captured.out
    assert " x " not in captured.out.split("cubestar", 1)[1]
    assert "compiled is absent: install a C++ compiler" in captured.err


def test_benchmark_fails_if_an_engine_stores_a_wrong_image(figures, capsys):
    figures({}, broken="cubestar-double")
    assert main([]) == 2
    assert "error: SRAM has 1 at row 0" in capsys.readouterr().err
