import json
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.boards.cubestar.compiled.build import COMPILER, compiler_version
from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.mcu import cortex_m3
from cubestack.host.devices.registry import device
from cubestack.host.studies import costs as command
from cubestack.host.studies.costs import CostMeasurement, CostReport
from cubestack.host.studies.cubestar.costs import COLUMNS, _cases, costs, measure
from tests.conftest import Run

DOCS = Path(__file__).parents[4] / "docs"


def recorded() -> list[CostMeasurement]:
    data = json.loads(costs().file.read_text("utf-8"))
    return [CostMeasurement(**build) for build in data["builds"]]


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_page_table_is_up_to_date() -> None:
    page = (DOCS / costs().document).read_text("utf-8")
    told = page.split("<!-- costs -->\n")[1].split("<!-- end of costs -->\n")[0].strip()
    assert costs().page(recorded()).strip() == told


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_charged_row_has_the_prices_that_were_just_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def charged() -> float:
        lines = costs().page([]).splitlines()
        return float(lines[2].split("|")[3])  # of the search

    before, data = charged(), json.loads(costs().file.read_text("utf-8"))
    for build in data["builds"]:
        build["operations"] = {name: 3 * cost for name, cost in build["operations"].items()}
    (tmp_path / "costs.json").write_text(json.dumps(data))
    monkeypatch.setattr(cortex_m3, "FILE", tmp_path / "costs.json")
    try:
        assert charged() > 1.5 * before
    finally:
        cortex_m3.load_measurements.cache_clear()


def test_cost_table_columns_contain_all_phases_but_attitude() -> None:
    for one in recorded():
        shown = {phase for group in COLUMNS.values() for phase in group}
        assert one.phases.keys() - shown == {"attitude"}  # the published sum has none
        assert shown < one.phases.keys()


def test_cost_cases_match_the_recorded_builds_and_timings() -> None:
    levels, kinds = costs().levels, costs().precisions
    cases = [(str(case.build), str(case.timing)) for case in _cases(levels, kinds)]
    assert cases == [(one.build, one.timing) for one in recorded()]
    usual = cases[0][1]
    assert len(set(cases)) == len(cases)
    others = [build for build, timing in cases if timing != usual]
    assert sorted(set(others)) == ["-O0 double", "-O2 own"]
    assert others.count("-O2 own") == others.count("-O0 double") == 4
    assert [str(case.build) for case in _cases(["Os"], ["float"])] == ["-Os float"]


@pytest.mark.slow
@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
@pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"no {COMPILER}")
def test_build_with_doubles_matches_the_recorded_costs() -> None:
    """Operands must be doubles too: functions are shorter for a converted float."""
    (found,) = measure(["Os"], ["double"])
    if json.loads(costs().file.read_text("utf-8"))["compiler"] != compiler_version():
        pytest.skip("recorded of another compiler")
    told = {(one.build, one.timing): one for one in recorded()}[found.build, found.timing]
    assert found.phases == told.phases
    assert found.operations == pytest.approx(told.operations, rel=0.1, abs=2)


BUILDS = [
    CostMeasurement("-O2 own", "usual", {"add": 1.5, "mul": 3.0}, {"a": 1000, "b": 234_567}),
    CostMeasurement("-O0 own", "usual", {"add": 2.5, "mul": 4.25}, {"a": 2000}),
    CostMeasurement("-O2 own", "slow", {"add": 9.0, "mul": 9.0}, {"a": 9000}),
]


@pytest.fixture
def report(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Any]:
    """A device with known costs; yields the requests for them."""
    asked = list[Any]()

    def measure(levels: Sequence[str], precisions: Sequence[str]) -> Iterator[CostMeasurement]:
        asked.append((levels, precisions))
        yield from BUILDS

    made = CostReport(
        levels=("O0", "O2"),
        precisions=("own",),
        measure=measure,
        as_data=lambda found: {"builds": [one.build for one in found]},
        file=tmp_path / "data.json",
        page=lambda found: f"| {len(found)} builds |",
        document="page.md",
        table={"add": 2.0, "mul": 3.25, "never compiled": 7.0},
    )
    devices = [
        replace(device("aramis"), studies={}),
        replace(device("cubestar"), studies={"costs": lambda: made}),
    ]
    monkeypatch.setattr(command, "devices", lambda: devices)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "page.md").write_text(PAGE, "utf-8")
    return asked


PAGE = "above\n<!-- costs -->\nold\n<!-- end of costs -->\nbelow\n"


def test_table_compares_measured_and_charged_operations(run: Run, report: list[Any]) -> None:
    found = run("costs", "measure")
    assert found.code == 0
    lines = [line.split() for line in found.out.splitlines()]
    assert lines[:3] == [
        ["-O2", "own,", "usual:", "235,567", "cycles"],
        ["-O0", "own,", "usual:", "2,000", "cycles"],
        ["-O2", "own,", "slow:", "9,000", "cycles"],
    ]
    assert ["add", "2", "1.5", "2.5"] in lines
    assert ["mul", "3.25", "3", "4.25"] in lines
    assert not any(line[:1] == ["never"] for line in lines)
    assert report == [(("O0", "O2"), ("own",))]


def test_json_is_one_object(run: Run, report: list[Any]) -> None:
    found = run("costs", "measure", "--level", "O2", "--json")
    assert json.loads(found.out) == {"builds": [one.build for one in BUILDS]}
    assert report == [(("O2",), ("own",))]


def test_write_updates_data_and_page(run: Run, report: list[Any], tmp_path: Path) -> None:
    assert run("costs", "measure", "--write").code == 0
    page = tmp_path / "docs" / "page.md"
    new = "above\n<!-- costs -->\n\n| 3 builds |\n\n<!-- end of costs -->\nbelow\n"
    assert page.read_text("utf-8") == new
    assert json.loads((tmp_path / "data.json").read_text("utf-8"))["builds"][0] == "-O2 own"
    run("costs", "measure", "--write")
    assert page.read_text("utf-8") == new


@pytest.mark.parametrize("cut", ["<!-- costs -->\n", "<!-- end of costs -->\n"])
def test_write_rejects_a_page_without_markers(
    run: Run, report: list[Any], tmp_path: Path, cut: str
) -> None:
    (tmp_path / "docs" / "page.md").write_text(PAGE.replace(cut, ""), "utf-8")
    found = run("costs", "measure", "--write")
    assert found.code == 2
    assert "page.md has no <!-- costs -->" in found.err


def test_rejects_devices_without_compiled_costs(
    run: Run, report: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    devices = command.devices()[:1]
    monkeypatch.setattr(command, "devices", lambda: devices)
    found = run("costs", "measure")
    assert found.code == 2
    assert "no device has a program to compile" in found.line


def test_missing_compiler_names_the_package(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    from cubestack.emulator.boards.cubestar.compiled import build

    build.compiler_version.cache_clear()
    monkeypatch.setattr(shutil, "which", lambda _program: None)
    outcome = run("costs", "measure", "--level", "O2")
    assert outcome.code == 1
    assert outcome.line.startswith("cubestack costs: arm-none-eabi-gcc is not installed: apt ")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"no {COMPILER}")
def test_costs_command_measures_a_build(run: Run) -> None:
    outcome = run("costs", "measure", "--level", "Os", "--precision", "own", "--json")
    (build,) = json.loads(outcome.out)["builds"]
    assert build["build"] == "-Os own"
    assert build["operations"]["f32_acos"] > 20 * build["operations"]["f32_mul"] > 0
    assert sum(build["phases"].values()) > 1_000_000
