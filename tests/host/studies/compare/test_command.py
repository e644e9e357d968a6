import json
from dataclasses import replace
from pathlib import Path

import pytest

from cubestack.host.studies.compare import page, recorded
from cubestack.host.studies.compare.recorded import Job, perform
from cubestack.host.studies.compare.studies import STUDIES
from cubestack.host.studies.compare.tracker import trackers
from cubestack.host.studies.rows.record import load, save
from tests.conftest import Run

DOCS = Path(__file__).parents[4] / "docs"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["identifcation"], "did you mean identification?"),
        (["identification", "cubesense"], "must be one of cubestar, aramis"),
        (["identification", "--skies", "0"], "--skies"),
        (["identification", "--seed", "-1"], "--seed"),
    ],
)
def test_refusals_are_one_line(run: Run, arguments: list[str], told: str) -> None:
    outcome = run("compare", *arguments)
    assert outcome.code == 2
    assert told in outcome.line


def test_out_needs_a_folder_and_a_place_in_its_page(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    assert "can not write" in run("compare", "identification", "--out", str(file)).line
    (tmp_path / page.PAGE).write_text("# Mine\n")
    outcome = run("compare", "identification", "--out", str(tmp_path))
    assert outcome.code == 2
    assert "has no line <!-- identification -->" in outcome.line
    assert (tmp_path / page.PAGE).read_text() == "# Mine\n"


@pytest.mark.slow
def test_renewed_rows_are_stored_with_what_they_depend_on(tmp_path: Path) -> None:
    job = Job("attitude", "cubestar", 2, 1)
    assert list(recorded.renewed(tmp_path, [job], 1)) == [job]
    stored = load(recorded.record_file(tmp_path))[job.key]
    assert stored.call == job.call
    assert stored.figures.keys() == recorded.figures(list(perform(job))).keys()
    assert any("attitude" in one for one in stored.depends)
    assert not stored.changed


@pytest.mark.slow
@pytest.mark.parametrize("study", STUDIES)
def test_json_has_an_object_per_method_and_case(run: Run, study: str) -> None:
    outcome = run("compare", study, "cubestar", "--skies", "1", "--json")
    rows = [json.loads(line) for line in outcome.out.splitlines()]
    assert len(rows) == STUDIES[study].rows
    assert {row["method"] for row in rows} == set(STUDIES[study].methods)
    assert len({(row["method"], row["case"]) for row in rows}) == len(rows)


def test_stored_rows_are_of_the_present_code() -> None:
    jobs = [
        Job(one.name, device, one.skies, 1) for one in STUDIES.values() for device in trackers()
    ]
    assert not recorded.stale(DOCS, jobs), "`make fidelity` measures them anew"
    assert set(load(recorded.record_file(DOCS))) == {job.key for job in jobs}


def test_stale_rows_are_named(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stored = load(recorded.record_file(DOCS))
    job = Job("attitude", "aramis", STUDIES["attitude"].skies, 1)
    one = stored[job.key]
    depends = ("host/studies/compare/attitude/methods.py 0000000000", *one.depends)
    save(recorded.record_file(tmp_path / "docs"), stored | {job.key: replace(one, depends=depends)})
    monkeypatch.chdir(tmp_path)
    found = run("compare", "attitude", "aramis", "--stale")
    assert found.code == 1
    reason = "changed since: host/studies/compare/attitude/methods.py"
    assert found.out.splitlines() == [f"attitude aramis: {reason}"]
    assert "it was" in run("compare", "attitude", "aramis", "--skies", "3", "--stale").out


@pytest.mark.parametrize("study", STUDIES)
def test_page_has_the_stored_rows(study: str) -> None:
    text = (DOCS / page.PAGE).read_text("utf-8")
    assert page.rewritten(text, DOCS, study) == text
    assert (DOCS / page.PICTURES / f"{study}.png").is_file()


def test_a_renewal_takes_at_most_a_minute_of_one_core() -> None:
    assert sum(one.seconds for one in load(recorded.record_file(DOCS)).values()) < 60


@pytest.mark.slow
@pytest.mark.parametrize("key", sorted(load(recorded.record_file(DOCS))))
def test_stored_rows_are_the_same_today(key: str) -> None:
    stored = load(recorded.record_file(DOCS))[key]
    words = stored.call.split()
    job = Job(words[1], words[2], int(words[4]), int(words[6]))
    assert job.call == stored.call
    assert recorded.figures(list(perform(job))) == pytest.approx(
        dict(stored.figures), rel=1e-8, nan_ok=True
    )
