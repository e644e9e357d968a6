"""The pages' rows: of the present code, as stored, and what they show when measured again."""

import random
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.devices.registry import BUILT_IN
from cubestack.host.studies.fidelity.recorded import (
    all_jobs,
    differences,
    pages,
    record_file,
    rows_of,
    stale,
)
from cubestack.host.studies.fidelity.table import Job, fidelity_of, perform
from cubestack.host.studies.rows.record import load, save
from tests.conftest import Run
from tests.tiers import DAY

DOCS = Path(__file__).parents[4] / "docs"

compiled = pytest.mark.skipif(find_compiler() is None, reason="needs the compiled FPGA")


def test_every_row_was_measured_with_the_present_code() -> None:
    found = [
        f"{job.device} {', '.join([job.key, *(row.key for row in rows_of(job))])}: {reason}"
        for job, reason in stale(DOCS, BUILT_IN).items()
    ]
    assert not found, "\n".join(["`make fidelity FIGURES=--stale` measures anew:", *found])


@pytest.mark.parametrize("device", BUILT_IN)
def test_pages_show_the_stored_figures(device: str) -> None:
    found = pages(DOCS, device)
    assert DOCS / fidelity_of(device).page in found
    for path, text in found.items():
        assert path.read_text("utf-8") == text, path.name


def test_records_have_no_other_measurements() -> None:
    for device in BUILT_IN:
        assert load(record_file(DOCS, device)).keys() == {job.key for job in all_jobs(device)}


@pytest.mark.parametrize("device", BUILT_IN)
def test_calls_are_the_same_in_every_process(device: str) -> None:
    assert not [one for one in fidelity_of(device).trials.values() if " at 0x" in one.call]


def test_all_rows_together_take_at_most_twenty_minutes_on_two_cores() -> None:
    stored = [one for name in BUILT_IN for one in load(record_file(DOCS, name)).values()]
    assert sum(one.seconds for one in stored) < 2 * 20 * 60


# --- measured again -------------------------------------------------------------------------------


JOBS = [job for device in BUILT_IN for job in all_jobs(device)]


@cache
def seconds(device: str) -> dict[str, float]:
    return {key: one.seconds for key, one in load(record_file(DOCS, device)).items()}


def case(job: Job) -> Any:
    """A test's case: daily below 20 s, else weekly."""
    long = seconds(job.device)[job.key] >= 20
    mark = pytest.mark.weekly if long else pytest.mark.daily
    return pytest.param(job, id=f"{job.device} {job.key}", marks=mark)


def check(job: Job) -> None:
    stored = load(record_file(DOCS, job.device))[job.key].figures
    assert not list(differences(job, stored, perform(job)))


@compiled
def test_a_short_row_is_the_same_today() -> None:
    stored = {name: load(record_file(DOCS, name)) for name in BUILT_IN}
    short = [job for job in JOBS if stored[job.device][job.key].seconds < 1]
    if short:
        check(random.Random(DAY).choice(short))


@compiled
@pytest.mark.slow
@pytest.mark.parametrize("job", [case(job) for job in JOBS])
def test_row_is_the_same_again(job: Job) -> None:
    check(job)


# --- stale ----------------------------------------------------------------------------------------


@pytest.fixture
def docs(tmp_path: Path) -> Path:
    save(record_file(tmp_path, "aramis"), load(record_file(DOCS, "aramis")))
    return tmp_path


def test_changed_code_makes_its_rows_stale_by_name(
    docs: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = record_file(docs, "aramis")
    stored = load(path)
    lookups = stored["lookups"]
    file = "firmware_model/aramis/matching/triples.py"
    (entry,) = (one for one in lookups.depends if one.startswith(file))
    others = tuple(one for one in lookups.depends if one != entry)
    save(path, stored | {"lookups": replace(lookups, depends=(*others, f"{file} 0000000000"))})
    assert {job.trial: reason for job, reason in stale(docs, ["aramis"]).items()} == {
        "lookups": f"changed since: {file}"
    }
    monkeypatch.chdir(docs.parent)
    (docs.parent / "docs").symlink_to(docs)
    found = run("fidelity", "aramis", "--stale")
    assert found.code == 1
    keys = "lookup-area, lookup-moment, lookup-both, lookup-pivot"
    assert found.out.splitlines() == [f"aramis, lookups: rows {keys}: changed since: {file}"]


def test_other_arguments_and_new_trials_make_rows_stale(docs: Path) -> None:
    path = record_file(docs, "aramis")
    stored = load(path)
    del stored["catalogue"]
    save(path, stored | {"lookups": replace(stored["lookups"], call="_lookups, 3 frames")})
    assert {job.trial: reason for job, reason in stale(docs, ["aramis"]).items()} == {
        "lookups": "it was _lookups, 3 frames",
        "catalogue": "never measured",
    }


def test_measurements_depend_on_firmware_camera_and_gateware() -> None:
    stored = load(record_file(DOCS, "cubesense"))["sun-still, published"]
    files = {one.partition(":")[0].partition(" ")[0] for one in stored.depends}
    assert files > {
        "firmware_model/cubesense/vision/sun_centroid.py",
        "firmware_model/mcu/pic18.py",
        "emulator/camera/ov7620/lens_error.py",
        "emulator/light/pixels.cpp",
        "hdl/cubesense/pair.py",
        "host/studies/cubesense/fidelity.py",
    }
    assert not {one for one in files if "aramis" in one or "ground" in one}
