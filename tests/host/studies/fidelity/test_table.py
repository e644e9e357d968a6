"""Published figures: what devices declare, the command that measures ours, and the pages."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.cli.main import make_parser
from cubestack.host.devices.registry import BUILT_IN, device
from cubestack.host.studies.fidelity import command as runs
from cubestack.host.studies.fidelity import recorded
from cubestack.host.studies.fidelity import table as fidelity
from cubestack.host.studies.fidelity.recorded import all_jobs, pages, record_file
from cubestack.host.studies.fidelity.table import Fidelity, Job, Row, fidelity_of, read_tables
from cubestack.host.studies.fidelity.text import names_in, pages_with_figures
from cubestack.host.studies.rows.estimate import Estimate
from cubestack.host.studies.rows.record import load, measurement, save
from cubestack.host.studies.rows.trial import Trial
from tests.conftest import Run

ROOT = Path(__file__).parents[4]
LEAST_ROWS = 60
NEVER = ("gyro-fastest", "threshold-sun", "reading-")
"""Beginnings of keys of rows that may lack a value: of what was never found."""


def test_rows_have_unique_keys() -> None:
    keys = {name: [row.key for row in fidelity_of(name).rows] for name in BUILT_IN}
    assert sum(map(len, keys.values())) >= LEAST_ROWS
    for name, own in keys.items():
        assert len(set(own)) == len(own), name


@pytest.mark.parametrize("name", BUILT_IN)
def test_every_row_has_a_trial_and_every_trial_is_shown(name: str) -> None:
    rows, docs = list(fidelity_of(name).rows), ROOT / "docs"
    told = {
        key.split(",")[0].removesuffix(":")
        for page in pages_with_figures(docs)
        for file, key, _ in names_in(page)
        if file == name
    }
    assert {row.trial for row in rows} | told == set(fidelity_of(name).trials)
    assert all(all((row.figure, row.source, row.published, row.ours)) for row in rows)


@pytest.mark.skipif(find_compiler() is None, reason="the whole stack needs the compiled FPGA")
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name == "aramis" else pytest.mark.slow) for name in BUILT_IN],
)
def test_quick_run_measures_every_row_in_both_profiles(run: Run, name: str) -> None:
    lines = run("fidelity", name, "--quick", "--json", "--workers", "1").out.splitlines()
    rows = [json.loads(line) for line in lines]
    assert [row["key"] for row in rows] == [row.key for row in fidelity_of(name).rows]
    for row in rows:
        assert set(row["ours"]) == {"published", "extended"}, row["key"]
        if row["key"].startswith(NEVER):
            continue
        for value in row["ours"].values():
            assert any(character.isdigit() for character in value), (row["key"], value)
            assert "-" not in re.split("[ ,;()]+", value), (row["key"], value)


@pytest.mark.parametrize("name", BUILT_IN)
def test_commands_of_the_rows_are_valid(name: str) -> None:
    parser, declared = make_parser(), fidelity_of(name)
    for command in {declared.command(name, row) for row in declared.rows}:
        parser.parse_args(command.split())


def test_rows_are_selected_by_key(run: Run) -> None:
    out = run("fidelity", "cubesense", "--rows", "power-*", "--workers", "1").out
    assert "table 7.1" in out
    assert "equation" not in out


@pytest.fixture
def lens_jobs() -> list[Job]:
    return fidelity.jobs_of("cubesense", ["lens", "power"])


def test_several_workers_give_the_same_figures(lens_jobs: list[Job]) -> None:
    told: list[Job] = []
    alone = fidelity.run_jobs(lens_jobs, 1, told.append)
    assert fidelity.run_jobs(lens_jobs, 2, told.append) == alone
    assert sorted(map(str, told)) == sorted(2 * [str(job) for job in lens_jobs])


def test_fitted_power_matches_the_published_power() -> None:
    for name in ("cubestar", "cubesense"):
        rows = [row for row in fidelity_of(name).rows if row.trial == "power"]
        assert {row.word for row in rows} == {"fitted"}
        jobs = fidelity.jobs_of(name, ["power"])
        (figures,) = fidelity.run_jobs(jobs, 1, lambda _job: None).values()
        for row in rows:
            published, ours = (
                float(text.split()[0]) for text in (row.published, fidelity.shown(row, figures))
            )
            assert ours == pytest.approx(published, rel=0.06), row.key


def test_trials_without_profile_run_once(lens_jobs: list[Job]) -> None:
    assert {job.trial for job in lens_jobs} == {"lens", "power"}
    assert len(lens_jobs) == 2


def test_number_of_frames_defaults_to_the_trial() -> None:
    trial = fidelity_of("cubesense").trials["nadir"]
    for options, frames in (({}, trial.frames), ({"quick": True}, trial.quick), ({"frames": 7}, 7)):
        assert {job.frames for job in fidelity.jobs_of("cubesense", ["nadir"], **options)} == {
            frames
        }


ROW = Row("a", "speed", "section 1", "3 m/s", "fitted", "walk", "{v:.1f} m/s")


def test_missing_figure_is_a_dash() -> None:
    assert fidelity.shown(ROW, {"v": float("nan")}) == "- m/s"
    assert fidelity.shown(ROW, {"v": 2.96}) == "3.0 m/s"


def test_rejects_a_table_with_an_unknown_word(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "published.md").write_text("## t\n| a | b | c | d | guessed | e | f |\n")
    monkeypatch.setattr(fidelity.resources, "files", lambda _package: tmp_path)
    with pytest.raises(ValueError, match="not the cells of key, figure"):
        read_tables("anything")


PAGE = "above\n<!-- rows: pace -->\nold\n<!-- end of rows -->\nbelow\n"


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The page of a device with one row, in place of AraMiS."""
    trials = {"walk": Trial(lambda opened, _frames: {"v": 2.5 + len(opened.board["profile"])})}
    walking = Fidelity("page.md", trials, {"pace": (ROW,)})
    sensor = replace(device("aramis"), studies={"fidelity": lambda: walking})
    monkeypatch.setattr(fidelity, "registered", lambda _name: sensor)
    (tmp_path / "page.md").write_text(PAGE)
    return tmp_path / "page.md"


def test_write_replaces_only_the_tables(page: Path) -> None:
    device, job = "aramis", Job("aramis", "walk", "published", 0, 1.0)
    figures = {"v": Estimate(2.5, 2.0, 3.0)}
    save(record_file(page.parent, device), {job.key: measurement("walk", 1.0, figures, [])})
    (found,) = pages(page.parent, device).values()
    assert found == PAGE  # a table without all of its values stays
    every = {one.key: measurement("walk", 1.0, figures, []) for one in all_jobs(device)}
    save(record_file(page.parent, device), every)
    (found,) = pages(page.parent, device).values()
    ours = "2.5 (2.0 to 3.0) m/s"
    cells = f"speed | section 1 | 3 m/s | {ours} | {ours} | fitted | `fidelity aramis --rows a`"
    assert f"| {cells} |\n" in found
    assert found.startswith("above\n")
    assert found.endswith("below\n")
    assert "old" not in found


@pytest.mark.parametrize("option", [("--quick",), ("--frames", "2")])
def test_write_rejects_parts_of_a_row(run: Run, option: tuple[str, ...]) -> None:
    assert "--write measures rows whole" in run("fidelity", "aramis", "--write", *option).line


@pytest.mark.slow
def test_write_measures_and_stores(run: Run, tmp_path: Path) -> None:
    shutil.copy(ROOT / "docs" / fidelity_of("cubesense").page, tmp_path)
    done = run(
        "fidelity", "cubesense", "--rows", "memory-free", "--write", tmp_path, "--workers", "1"
    )
    assert done.code == 0
    (stored,) = load(record_file(tmp_path, "cubesense")).items()
    assert stored[0] == "memory"
    assert stored[1].call == "_memory"
    assert stored[1].changed == []
    assert any(
        one.startswith("host/studies/cubesense/fidelity.py:_memory ") for one in stored[1].depends
    )


def test_write_rejects_a_page_without_markers_before_measuring(
    run: Run, page: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorded, "measured_anew", None)
    page.write_text("nothing\n")
    for folder in (page.parent, page.parent / "none"):
        refused = run("fidelity", "aramis", "--write", folder)
        assert refused.code == 2
        assert "has no <!-- rows: pace -->" in refused.line


def test_remaining_time_scales_with_the_time_so_far(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Jobs of 10, 20 and 30 s on a machine that needs twice as long."""
    clock = iter([100.0, 120.0, 160.0, 220.0])
    monkeypatch.setattr(runs, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    jobs = [Job("cubestar", f"of {n}", "published", 1, n) for n in (10.0, 20.0, 30.0)]
    told = runs._Rest(jobs, quiet=False)
    assert [told(job) for job in jobs] == [1, 2, 3]
    times = [line.split("published: ")[1] for line in capsys.readouterr().err.splitlines()]
    expected = ((20, 100), (60, 60), (120, 0))
    assert times == [f"{took} s, about {rest} s to go" for took, rest in expected]


def test_quiet_counts_without_output(capsys: pytest.CaptureFixture[str]) -> None:
    job = Job("cubestar", "loop", "published", 1, 10.0)
    told = runs._Rest([job, job], quiet=True)
    assert [told(job), told(job)] == [1, 2]
    assert capsys.readouterr() == ("", "")
