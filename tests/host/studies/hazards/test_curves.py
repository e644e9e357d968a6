import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
import scipy  # which loads its parts when they are used
from PIL import Image

from cubestack.host.devices.registry import device
from cubestack.host.experiments.hazard_options import known
from cubestack.host.experiments.rates import wilson
from cubestack.host.studies.hazards import recorded
from cubestack.host.studies.hazards.command import PAGE, PICTURES, _merged
from cubestack.host.studies.hazards.curves import (
    Job,
    Point,
    devices_with_hazards,
    hazards_of,
    jobs_of,
)
from cubestack.host.studies.hazards.curves import run as run_jobs
from cubestack.host.studies.rows.record import load, measurement, save
from tests.conftest import Run
from tests.together import together


@pytest.mark.parametrize(("count", "of"), [(0, 20), (1, 20), (13, 40), (20, 20), (3, 1000)])
def test_wilson_limits_match_scipy(count: int, of: int) -> None:
    other = scipy.stats.binomtest(count, of).proportion_ci(0.95, "wilson")
    assert wilson(count, of) == pytest.approx((other.low, other.high), abs=1e-5)
    assert wilson(0, 0) == (0.0, 1.0)


def test_star_trackers_have_hazards_of_the_sky() -> None:
    assert {"cubestar", "aramis"} <= set(devices_with_hazards())
    assert {"moon", "protons", "gradient"} <= set(hazards_of(device("cubestar")))


def test_only_cubesense_has_hazards_of_the_earth() -> None:
    of_earth = {"clouds", "terminator", "earth-in-sun-camera"}
    assert of_earth <= set(hazards_of(device("cubesense")))
    assert not of_earth & {*hazards_of(device("cubestar")), *hazards_of(device("aramis"))}


def test_hazard_curve_counts_one_image_per_camera_and_frame() -> None:
    (point,) = run_jobs([Job("cubesense", "extended", "terminator", 0.0, 2, 4)], 1)
    assert (point.pictures, point.right) == (4, 4)


JOBS = [Job("cubestar", "extended", "gradient", strength, 2, 4) for strength in (0.0, 60.0)]


@pytest.mark.slow
def test_points_do_not_depend_on_the_number_of_workers() -> None:
    assert list(run_jobs(JOBS, 1)) == list(run_jobs(JOBS, 2))


def test_points_count_all_frames() -> None:
    alone = list(run_jobs(JOBS, 1))
    assert [point.strength for point in alone] == [0.0, 60.0]
    assert all(point.right + point.refused + point.wrong == 2 for point in alone)
    assert alone[0].right == 2


def test_dark_sky_is_refused_with_a_reason() -> None:
    (point,) = run_jobs([Job("cubestar", "extended", "defocus", 6.0, 2, 4)], 1)
    assert point.wrong == 0
    assert sum(point.reasons.values()) == point.refused


DOCS = Path(__file__).parents[4] / "docs"


@together("name", sorted(known()))
def test_page_shows_each_hazard_for_each_device(name: str) -> None:
    page = (DOCS / PAGE).read_text("utf-8")
    (section,) = re.findall(rf"^## {name}\n(.*?)(?=^## |^<!--)", page, re.DOTALL | re.MULTILINE)
    shown = [part.name for part in (DOCS / PICTURES).glob(f"{name}-*")]
    takers = [taker for taker in devices_with_hazards() if name in hazards_of(device(taker))]
    assert sorted(re.findall(r"hazards/([\w.-]+)\)", section)) == sorted(
        [f"{name}-curve.png", *(f"{name}-{taker}.jpg" for taker in takers)]
    )
    assert set(re.findall(r"hazards/([\w.-]+)\)", section)) <= set(shown)


def test_page_numbers_match_the_points() -> None:
    page = (DOCS / PAGE).read_text("utf-8")
    lines = (DOCS / PICTURES / "points.jsonl").read_text("utf-8").splitlines()
    points = [json.loads(line) for line in lines]
    assert {point["hazard"] for point in points} == set(known())
    for point in points:
        pictures = point["right"] + point["refused"] + point["wrong"]
        row = (
            f"| {device(point['device']).title} | {point['strength']:g} "
            f"| {point['right']} of {pictures} | {point['refused']}"
        )
        assert row in page


FRAMES, SEED = 8, 1
"""Of the curves of the page."""


def curves_of(name: str) -> list[recorded.Curve]:
    return recorded.curves_of(jobs_of(name, [], FRAMES, SEED, "extended"))


def test_curves_were_measured_with_the_present_code() -> None:
    every = [curve for name in devices_with_hazards() for curve in curves_of(name)]
    found = [f"{recorded.key(one[0])}: {why}" for one, why in recorded.stale(DOCS, every).items()]
    assert not found, "\n".join(["`make fidelity FIGURES=--stale` measures anew:", *found])
    stored = load(recorded.record_file(DOCS))
    assert stored.keys() == {recorded.key(curve[0]) for curve in every}


def test_curves_of_the_page_are_the_stored_ones() -> None:
    lines = (DOCS / PICTURES / "points.jsonl").read_text("utf-8").splitlines()
    points = [Point(**json.loads(line)) for line in lines]
    for name, stored in load(recorded.record_file(DOCS)).items():
        assert recorded.figures([p for p in points if recorded.key(p) == name]) == stored.figures


def test_stale_curves_are_named(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    first, second, *_ = curves_of("aramis")
    now = measurement(recorded.call(first), 1.0, {}, [])
    save(
        recorded.record_file(tmp_path / "docs"),
        {
            recorded.key(first[0]): replace(now, depends=("host/devices/device.py 0000000000",)),
            recorded.key(second[0]): measurement("hazards --frames 3", 1.0, {}, []),
        },
    )
    names = ("--hazard", first[0].hazard, "--hazard", second[0].hazard, "--hazard", "wobble")
    found = run("hazards", "aramis", *names, "--frames", FRAMES, "--seed", SEED, "--stale")
    assert found.code == 1
    assert found.out.splitlines() == [
        f"aramis {first[0].hazard}: changed since: host/devices/device.py",
        f"aramis {second[0].hazard}: it was hazards --frames 3",
        "aramis wobble: never measured",
    ]


@pytest.mark.slow
@pytest.mark.weekly
@pytest.mark.parametrize("name", sorted(load(recorded.record_file(DOCS))))
def test_curve_is_the_same_again(name: str) -> None:
    stored = load(recorded.record_file(DOCS))[name]
    device, hazard = name.split()
    jobs = list(jobs_of(device, [hazard], FRAMES, SEED, "extended"))
    assert recorded.call(tuple(jobs)) == stored.call
    assert recorded.figures(list(run_jobs(jobs, 1))) == stored.figures


@pytest.mark.slow
def test_out_writes_images_curves_and_points(tmp_path: Path, run: Run) -> None:
    arguments = ("--hazard", "gradient", "--frames", "1", "--workers", "1", "--out", tmp_path)
    lines = run("hazards", "cubestar", *arguments, "--json").out.splitlines()
    printed = [json.loads(line) for line in lines]
    pictures = tmp_path / "images" / "hazards"
    stored = (pictures / "points.jsonl").read_text("utf-8").splitlines()
    assert [json.loads(line) for line in stored] == printed
    assert {point["strength"] for point in printed} >= {0, 60}
    with Image.open(pictures / "gradient-cubestar.jpg") as sample:
        assert sample.size == (480, 240)
    with Image.open(pictures / "gradient-curve.png") as curve:
        assert curve.width > 300
    page = (tmp_path / "hazards.md").read_text("utf-8")
    assert "## gradient" in page
    assert "| CubeStar | 60 | " in page
    ((name, one),) = load(recorded.record_file(tmp_path)).items()
    assert (name, one.changed) == ("cubestar gradient", [])
    assert one.figures["60 right"] + one.figures["60 refused"] + one.figures["60 wrong"] == 1
    assert any("hazards/veils.py:" in entry for entry in one.depends)
    assert any("matching/confirmed.py:" in entry for entry in one.depends)


def test_new_points_replace_those_of_their_curve(tmp_path: Path) -> None:
    def point(device: str, hazard: str, strength: float, right: int) -> Point:
        return Point(device, "extended", hazard, strength, 2, 4, right, 2 - right, 0, {})

    old = [point("cubestar", "moon", 0.0, 1), point("cubestar", "veil", 0.0, 1)]
    file = tmp_path / "points.jsonl"
    file.write_text("".join(json.dumps(one.as_dict()) + "\n" for one in old))
    new = [point("aramis", "moon", 0.0, 2), point("cubestar", "moon", 0.5, 2)]
    assert set(map(repr, _merged(new, file))) == set(map(repr, [*new, old[1]]))
    assert _merged(new, tmp_path / "none") == sorted(new, key=lambda one: one.device == "aramis")


def test_rejects_a_page_without_markers_and_a_file_as_folder(tmp_path: Path, run: Run) -> None:
    (tmp_path / "hazards.md").write_text("mine\n", "utf-8")
    for out, error in (
        (tmp_path, "hazards.md has no lines <!-- hazards -->"),
        (tmp_path / "hazards.md", "is a file; a folder would be right"),
    ):
        outcome = run("hazards", "cubestar", "--out", out)
        assert (outcome.code, error in outcome.line) == (2, True)
