"""`cubestack measure cubesense`: accuracy, edges and times beside the published ones.

CubeSense thesis, sections 5.8, 7.1, 7.2, 7.4 and 8.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import Run
from tests.system.conftest import Frames, Measure

KEYS = {
    "sensor", "detected", "alpha_deg", "beta_deg", "truth_alpha_deg", "truth_beta_deg",
    "error_deg", "tolerance_deg", "right", "edges", "phase_ms", "wall_ms",
}  # fmt: skip
SUN, NADIR = ("--sensor", "sun"), ("--sensor", "nadir")
EXTENDED, NOMINAL = ("--profile", "extended"), ("--set", "lens=nominal")


@pytest.fixture(scope="module")
def nadir(measure: Measure) -> Frames:
    return measure(*NADIR, "--frames", 60, "--seed", 3, *EXTENDED)


@pytest.fixture(scope="module")
def sun(measure: Measure) -> Frames:
    return measure(*SUN, "--frames", 60, "--seed", 3, *EXTENDED)


def test_frame_has_one_result_per_sensor(measure: Measure) -> None:
    frames = measure("--frames", 2)
    assert [frame["sensor"] for frame in frames] == ["sun", "nadir"] * 2
    assert all(frame.keys() >= KEYS for frame in frames)
    assert all(f["right"] == (f["error_deg"] <= f["tolerance_deg"]) for f in frames)
    assert frames[0]["phase_ms"].keys() == {"wait", "store", "search", "centroid", "total"}


@pytest.mark.slow
def test_nadir_sensor_meets_its_goal_with_the_published_number_of_edges(nadir: Frames) -> None:
    assert all(frame["detected"] for frame in nadir)
    for axis in ("alpha", "beta"):
        errors = np.array([f[f"{axis}_deg"] - f[f"truth_{axis}_deg"] for f in nadir])
        mean, sigma = np.abs(errors).mean(), errors.std()
        assert mean < 0.12
        assert sigma < 0.18
        assert mean + sigma < 0.2
    assert all(18 <= frame["edges"] <= 24 for frame in nadir)


@pytest.mark.slow
def test_sun_sensor_meets_its_goal(sun: Frames) -> None:
    assert all(frame["detected"] for frame in sun)
    angle = np.array([np.hypot(f["truth_alpha_deg"], f["truth_beta_deg"]) for f in sun])
    errors = np.array([frame["error_deg"] for frame in sun])
    assert np.percentile(errors[angle <= 45], 95) < 0.2
    assert np.percentile(errors[angle > 45], 95) < 2
    assert [f["tolerance_deg"] for f in sun] == np.where(angle > 45, 2.0, 0.2).tolist()


@pytest.mark.slow
@pytest.mark.parametrize("bloom", [5, 6, 7])
def test_sun_sensor_meets_its_goal_with_other_bloom_sizes(measure: Measure, bloom: float) -> None:
    angles = ("--bloom", bloom, "--sun-angle", 45)
    frames = measure(*SUN, *angles, "--frames", 12, "--seed", 5, *EXTENDED)
    assert np.percentile([frame["error_deg"] for frame in frames], 95) < 0.2


@pytest.mark.slow
def test_times_match_the_published_times(nadir: Frames, sun: Frames) -> None:
    """The nadir time is a prediction, the lower end of its range; the published is 245 ms.

    The wait for a frame is uniform over 33.4 ms, so its sigma is 33.4 / sqrt(12) = 9.6 ms; the
    published value is 11 ms.
    """
    total = np.array([frame["phase_ms"]["total"] for frame in nadir])
    assert total.mean() == pytest.approx(322, abs=15)
    waits = np.array([frame["phase_ms"]["wait"] for frame in (*nadir, *sun)])
    assert waits.std() == pytest.approx(33.37 / np.sqrt(12), rel=0.15)
    assert all(frame["phase_ms"]["store"] == pytest.approx(30.5, abs=0.1) for frame in nadir)


@pytest.mark.slow
@pytest.mark.parametrize("which", [NADIR, SUN], ids=lambda which: which[1])
def test_published_profile_is_faster_and_less_accurate(
    measure: Measure, nadir: Frames, sun: Frames, which: tuple[str, str]
) -> None:
    printed = measure(
        *which, "--frames", 20, "--seed", 3, "--profile", "published", "--set", "lens=nominal"
    )
    ours = (nadir if which == NADIR else sun)[:20]
    assert all(frame["detected"] for frame in printed)
    errors, better = ([one["error_deg"] for one in found] for found in (printed, ours))
    assert 2 * np.mean(better) < np.mean(errors) < max(errors) < 0.5
    for one, other in zip(printed, ours, strict=True):
        assert one["phase_ms"]["centroid"] < other["phase_ms"]["centroid"]


def test_same_seed_gives_the_same_results(measure: Measure) -> None:
    first, second = (measure("--frames", 1, "--seed", 8) for _ in range(2))
    for frame in (*first, *second):
        del frame["wall_ms"]
    assert first == second


@pytest.mark.slow
def test_other_memory_returns_the_same_directions(measure: Measure) -> None:
    own, other = (measure("--memory", memory, "--seed", 4) for memory in ("own", "other"))
    for one, another in zip(own, other, strict=True):
        assert another["capture"] == "stored_other_sram"
        # Another frame, so other noise: two sensors' steps of 0.01 deg, and a little.
        assert another["error_deg"] == pytest.approx(one["error_deg"], abs=0.04)


@pytest.mark.slow
def test_sample_search_reads_fewer_pixels(measure: Measure) -> None:
    ways = ("lines", "samples", "stepping")
    lines, halves, stepping = (measure(*NADIR, *NOMINAL, "--search", way) for way in ways)
    for line, half, step in zip(lines, halves, stepping, strict=True):
        assert half["pixels_read"] < step["pixels_read"] / 2 < line["pixels_read"] / 15
        assert half["phase_ms"]["search"] < line["phase_ms"]["search"] / 2
        # The same picture has the same edges, however they are found.
        assert (half["alpha_deg"], half["beta_deg"]) == (step["alpha_deg"], step["beta_deg"])
        assert half["error_deg"] < 0.2


def test_measure_uses_the_scene_file(measure: Measure, tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text('kind = "earth-sun"\nsun_deg = [20, 10]\nnadir_deg = [-8, 12]\n')
    sun, nadir = measure("--scene", scene, *NOMINAL)
    assert (sun["truth_alpha_deg"], sun["truth_beta_deg"]) == pytest.approx((20, 10))
    assert (nadir["truth_alpha_deg"], nadir["truth_beta_deg"]) == pytest.approx((-8, 12))
    assert max(sun["error_deg"], nadir["error_deg"]) < 0.1


def ball(run: Run, *options: str) -> list[dict[str, float]]:
    code, out, err = run("ball", "--step", "30", "--samples", "2", "--json", *options)
    assert (code, err) == (0, "")
    return [json.loads(line) for line in out.splitlines()]


def test_ball_command_measures_all_directions_with_each_profile(run: Run) -> None:
    published = ball(run, "--profile", "published")
    mean = sum(line["offset_deg"] for line in published) / 4
    assert 0.04 < mean < 0.4  # published: 0.12 to 0.16
    assert [line["direction"] for line in published] == ["right", "left", "down", "up"]
    assert all(line["detected"] == line["pictures"] == 4 for line in published)
    # 10 mm before the axis: 0.88 deg more at 30 deg, none at 0.
    off = ball(run, "--profile", "extended", "--off-axis", "10")
    assert all(line["offset_deg"] == pytest.approx(0.44, abs=0.04) for line in off)
    assert all(line["sigma_deg"] < 0.05 for line in off)
