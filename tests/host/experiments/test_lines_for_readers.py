from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.experiments.attitude import AttitudeExperiment, AttitudeResult, arcsec
from cubestack.host.experiments.cubesense import measure as cubesense
from cubestack.host.experiments.cubesense.measure import SensorResult
from cubestack.host.experiments.cubestar import measure as cubestar
from cubestack.host.experiments.cubestar.measure import CubeStarResult
from cubestack.host.experiments.facts import Facts, Telling
from cubestack.host.experiments.rates import outcome
from cubestack.host.studies.cubesense import ball
from cubestack.host.studies.cubestar.layouts import EXPERIMENT as LAYOUTS
from cubestack.host.studies.cubestar.layouts import LayoutResult

RIGHT = AttitudeResult(
    solved=True,
    right=True,
    centroids=12,
    matched=9,
    wrong=0,
    mode="lis",
    error_cross_deg=0.01,
    error_roll_deg=-0.02,
    truth=[0.0, 0.0, 0.0, 1.0],
    quaternion=[0.0, 0.0, 0.0, 1.0],
    **dict.fromkeys(("reason", "false_alarm", "sigma_deg", "error_deg")),
    phase_ms={"detect": 100.0},
    wall_ms=1.0,
    status="calculated",
)
WRONG = replace(RIGHT, right=False, wrong=3, error_cross_deg=5.0)
NONE = {"error_cross_deg": None, "error_roll_deg": None, "quaternion": None}
REFUSED = replace(RIGHT, solved=False, right=False, matched=0, reason="too few", **NONE)
UNKNOWN = replace(RIGHT, right=None, wrong=None, truth=None, **NONE)


class Trackers(AttitudeExperiment[Any, Any, AttitudeResult]):
    def run(self, opened: Any, options: Any) -> Iterator[AttitudeResult]:
        return iter(())


EXPERIMENT = Trackers()


def summary(*results: AttitudeResult) -> str:
    return "\n".join(EXPERIMENT.summarise(results, 2.5))


class Given(Telling):
    def run(self, _opened: Any, _options: Any) -> Iterator[Facts]:
        yield Facts({"name": "sun", "angle_deg": 1.5, "found": None})


def test_default_result_row_has_the_values_in_order() -> None:
    (result,) = Given().run(None, None)
    assert Given().row(0, result) == ("sun", "1.5", "None")


@pytest.mark.parametrize(
    ("result", "row"),
    [
        (RIGHT, ("7", "yes", "12", "9", "0", "36.0", "-72.0", "calculated")),
        (WRONG, ("7", "no", "12", "9", "3", "18000.0", "-72.0", "calculated")),
        (REFUSED, ("7", "no fix", "12", "0", "0", "-", "-", "calculated")),
        (UNKNOWN, ("7", "-", "12", "9", "-", "-", "-", "calculated")),
    ],
)
def test_attitude_result_prints_as_a_row(result: AttitudeResult, row: tuple[str, ...]) -> None:
    assert EXPERIMENT.row(7, result) == row
    assert len(row) == len(EXPERIMENT.columns)


def test_rates_count_all_frames() -> None:
    told = summary(RIGHT, RIGHT, WRONG, REFUSED, replace(REFUSED, reason=None), UNKNOWN)
    assert told.startswith(
        "of 6: 66.7 % solved, 33.3 % right, 1 wrong, 2.5 s wall time\nrefused: 1 too few\n"
    )
    assert summary(RIGHT).startswith("of 1: 100.0 % solved, 100.0 % right, 0 wrong")
    assert summary() == "of 0: 0.0 % solved, 0.0 % right, 0 wrong, 2.5 s wall time"
    assert "refused" not in summary(RIGHT, UNKNOWN)
    many = [replace(REFUSED, reason=reason) for reason in ("dark", "few", "dark")]
    assert "refused: 2 dark, 1 few" in summary(*many)


def test_percentiles_count_right_frames_only() -> None:
    several = [
        replace(RIGHT, error_cross_deg=n / 3600, error_roll_deg=-2 * n / 3600) for n in range(101)
    ]
    told = summary(*several, WRONG)
    assert "95th percentile of the right ones: 95.0 arcsec across, 190.0 about" in told
    assert "mean time" not in told
    timed = [replace(RIGHT, phase_ms={"total": ms}) for ms in (100.0, 300.0)]
    assert "; mean time 200 ms" in summary(*timed, replace(WRONG, phase_ms={"total": 900.0}))
    assert "95th" not in summary(WRONG, REFUSED)


def test_summary_counts_axes_within_the_claimed_sigma() -> None:
    claimed = replace(RIGHT, sigma_deg=[0.1, 0.1, 0.2], error_deg=[0.05, -0.2, 0.7])
    told = summary(claimed, replace(claimed, error_deg=[0.01, -0.02, -0.1]), RIGHT)
    assert "67 % are within the claimed sigma, 83.3 % within three" in told
    assert "claimed" not in summary(RIGHT, replace(RIGHT, sigma_deg=[0.1, 0.1, 0.1]))


@pytest.mark.parametrize(("right", "helps"), [(1, True), (2, False), (3, False)])
def test_advice_is_printed_when_less_than_half_is_right(right: int, helps: bool) -> None:
    told = summary(*[RIGHT] * right, *[REFUSED] * (4 - right), *[UNKNOWN] * 9)
    assert ("what may help: --mode assisted" in told) == helps


def test_no_advice_without_truth() -> None:
    assert "what may help" not in summary(UNKNOWN)


def test_report_section_needs_a_known_truth() -> None:
    pytest.importorskip("matplotlib")
    (section,) = EXPERIMENT.sections([vars(RIGHT), vars(UNKNOWN), vars(REFUSED)])
    assert section.png.startswith(b"\x89PNG")
    assert list(EXPERIMENT.sections([vars(UNKNOWN)])) == []


def test_degrees_are_printed_as_arcseconds() -> None:
    assert (arcsec(None), arcsec(0.5), arcsec(-0.001)) == ("-", "1800.0", "-3.6")


# --- CubeStar -------------------------------------------------------------------------------------


def star_tracker(**more: Any) -> CubeStarResult:
    return CubeStarResult(**vars(RIGHT) | more, threshold=25, searched=False)


def test_summary_names_a_searched_threshold() -> None:
    told = list(cubestar.EXPERIMENT.summarise([replace(star_tracker(), searched=True)], 1.0))
    assert told[0].startswith("detection threshold 25 DN, from a search")
    assert "from a search" not in " ".join(cubestar.EXPERIMENT.summarise([star_tracker()], 1.0))


def test_summary_compares_the_longest_steps_with_their_limits() -> None:
    times = {"detect": 100.0, "match": 7.0}, {"detect": 90.0, "match": 12.25}
    results = [star_tracker(phase_ms=one) for one in times]
    told = "\n".join(cubestar.EXPERIMENT.summarise(results, 1.0))
    assert "longest, ms: detect 100.0 of 220, match 12.2 of 250, attitude 0.0 of 30" in told


@pytest.mark.parametrize(
    ("stars", "advice"),
    [
        (2, "2 stars found: --threshold below 25"),
        (3, "--mode assisted --hint-error 5"),
        (19, "--mode assisted --hint-error 5"),
        (20, "pictures full of stars: --threshold above 25"),
    ],
)
def test_advice_depends_on_the_number_of_stars(stars: int, advice: str) -> None:
    results = [star_tracker(centroids=count) for count in (0, stars, 99)]
    assert cubestar.EXPERIMENT.advice(results).startswith(advice)
    assert cubestar.EXPERIMENT.advice([star_tracker(centroids=stars)]).startswith(advice)


LAYOUT = LayoutResult(
    **{"layout": "2", "fpgas": 1, "pins": 70, "tiles": 500, "fits": True},
    **{"attitudes": 9, "right": 9, "rate_hz": 2.0, "violations": 0, "published": "2 Hz"},
    **{"age_ms": 812.4, "oldest_ms": 1312.6, "power_mw": 396.2, "energy_mj": 198.4},
    phase_ms={"transfer": 404.1},
)


def test_layout_rows_mark_what_cannot_be_built() -> None:
    row = LAYOUTS.row(0, LAYOUT)
    assert row == ("2", "2.00", "812 to 1313", "396", "198", "404", "70", "500")
    two = replace(LAYOUT, layout="two", fpgas=2, pins=99, fits=False)
    assert LAYOUTS.row(0, two)[-2:] == ("2 x 99 (!)", "2 x 500")
    nothing = dict.fromkeys(("rate_hz", "age_ms", "oldest_ms", "power_mw", "energy_mj"))
    assert LAYOUTS.row(0, replace(LAYOUT, **nothing))[1:5] == ("-", "- to -", "-", "-")
    lines = list(LAYOUTS.summarise([LAYOUT, two], 1.0))
    assert lines[:2] == ["published for 2: 2 Hz", "published for two: 2 Hz"]
    assert lines[2:] == ["(!) layout two can't be built: an AGLN030 has 77 pins"]
    assert LAYOUTS.succeeded([LAYOUT, two])
    assert not LAYOUTS.succeeded([LAYOUT, replace(LAYOUT, attitudes=0)])


# --- CubeSense ------------------------------------------------------------------------------------

SUN = SensorResult(
    sensor="sun",
    detected=True,
    alpha_deg=10.0,
    beta_deg=-5.0,
    truth_alpha_deg=10.1,
    truth_beta_deg=-5.0,
    error_deg=0.1,
    tolerance_deg=0.2,
    right=True,
    **dict.fromkeys(("sigma_deg", "edges")),
    reason="none",
    sun_pixels=150,
    pixels_read=9,
    capture="stored",
    detect="detected",
    phase_ms={"wait": 5.0, "search": 20.0, "total": 50.0},
    wall_ms=1.0,
)
NADIR = replace(SUN, sensor="nadir", edges=40, sun_pixels=None)
NOTHING: dict[str, Any] = {
    **dict.fromkeys(("alpha_deg", "beta_deg", "error_deg")),
    **{"detected": False, "right": False, "detect": "failed"},
}


def told_of_sensors(*results: SensorResult) -> list[str]:
    return list(cubesense.EXPERIMENT.summarise(results, 3.25))


def test_direction_result_prints_as_a_row() -> None:
    row = cubesense.EXPERIMENT.row(0, SUN)
    numbers = ("10.00", "10.10", "-5.00", "-5.00", "0.100", "-", "150", "50.0")
    assert row == ("sun", *numbers, "detected")
    assert len(row) == len(cubesense.EXPERIMENT.columns)
    rated = cubesense.EXPERIMENT.row(0, replace(NADIR, sigma_deg=(0.03, 0.04)))
    assert rated[6:8] == ("0.050", "40")
    nothing = cubesense.EXPERIMENT.row(0, replace(SUN, **NOTHING, truth_alpha_deg=None))
    assert nothing[1:6] == ("-", "-", "-", "-5.00", "-")


@pytest.mark.parametrize(
    ("more", "ending"),
    [
        ({}, "detected"),
        ({"reason": "found"}, "detected"),
        (NOTHING, "failed"),
        (NOTHING | {"reason": "too_dark"}, "failed: too_dark"),
        ({"capture": "timeout"}, "timeout"),
        ({"capture": "stored_late"}, "detected"),
    ],
)
def test_last_column_names_the_reason(more: dict[str, Any], ending: str) -> None:
    assert cubesense.EXPERIMENT.row(0, replace(SUN, **more))[-1] == ending


def test_outcome_distinguishes_wrong_from_refused() -> None:
    assert outcome(SUN) == "right"
    assert outcome(replace(SUN, right=False)) == "wrong"
    assert outcome(replace(SUN, **NOTHING)) == "refused"


def test_summary_has_one_line_per_sensor() -> None:
    slow = replace(SUN, error_deg=0.3, right=False, phase_ms=SUN.phase_ms | {"total": 70.0})
    lines = told_of_sensors(SUN, slow, replace(SUN, **NOTHING), NADIR)
    assert lines == [
        "sun: 2 of 3 detected, 1 right; error: mean 0.200, 95th percentile 0.290 deg; "
        "time 60.0 ms, at most 70.0",
        "nadir: 1 of 1 detected, 1 right; error: mean 0.100, 95th percentile 0.100 deg; "
        "time 50.0 ms, at most 50.0",
        "3.2 s wall time",
    ]
    assert told_of_sensors(replace(SUN, **NOTHING))[0] == "sun: 0 of 1 detected, 0 right"


def test_sensor_summary_compares_errors_with_sigma_on_both_axes() -> None:
    times = {"a": 3.0, "b": 9.0, "total": 20.0}
    rated = replace(SUN, sigma_deg=(0.2, 0.01), beta_deg=-4.95, phase_ms=times)
    other = replace(rated, sigma_deg=(0.01, 0.2), phase_ms=times | {"a": 11.5, "total": 30.0})
    lines = told_of_sensors(rated, other)
    assert lines[1] == "sun: 50 % inside of 1 sigma, 50.0 % of 3; longest step: a, 11.5 ms"
    assert len(told_of_sensors(replace(rated, error_deg=None))) == 2


@pytest.mark.parametrize(
    ("sensor", "angle_deg", "claimed", "goal"),
    [
        (Camera.SUN, 44.9, None, 0.2),
        (Camera.SUN, 45.1, None, 2.0),
        (Camera.NADIR, 60.0, None, 0.2),
        (Camera.NADIR, 10.0, (0.05, 0.06), 0.2),
        (Camera.NADIR, 10.0, (0.1, 0.2), 0.6),
        (Camera.SUN, 60.0, (0.1, 0.2), 2.0),
    ],
)
def test_direction_tolerance_is_the_goal_or_three_sigma(
    sensor: Camera, angle_deg: float, claimed: tuple[float, float] | None, goal: float
) -> None:
    angle = np.radians(angle_deg)
    truth: Any = SimpleNamespace(vector=np.array([np.sin(angle), 0.0, np.cos(angle)]))
    assert cubesense._tolerance_deg(sensor, truth, claimed) == pytest.approx(goal)
    assert cubesense._tolerance_deg(sensor, None, None) == 0.2


def test_random_pose_keeps_its_angles_and_is_lit_from_behind() -> None:
    rng = np.random.default_rng(3)
    options = cubesense.CubeSenseOptions(tilt=12.0, sun_angle=60.0, bloom=3.0, no_noise=True)
    found: dict[Camera, list[float]] = {camera: [] for camera in Camera}
    for _ in range(300):
        for camera in Camera:
            view = cubesense.random_view(options, camera, rng)
            scene: Any = view.scene
            truth = scene.truth(CameraTarget(camera), 0)
            found[camera].append(float(np.hypot(truth.alpha_deg, truth.beta_deg)))
            assert np.allclose(np.asarray(scene.sun), -np.asarray(scene.nadir))
            assert (view.condition.bloom_px, view.condition.noise) == (3.0, False)
            assert scene.altitude_km == 750.0
    for camera, limit in ((Camera.SUN, 60.0), (Camera.NADIR, 12.0)):
        angles = np.array(found[camera])
        assert angles.max() < limit * 1.01
        # As many as the area has: a quarter within half of the angle.
        assert 0.15 < np.mean(angles < limit / 2) < 0.36
    usual = cubesense.random_view(cubesense.CubeSenseOptions(), Camera.SUN, rng)
    assert (usual.condition.bloom_px, usual.condition.noise) == (7.0, True)


def test_ball_experiment_prints_row_and_summary() -> None:
    result = ball.BallResult("left", 9, 10, 0.1234, 0.2, 0.05)
    assert ball.EXPERIMENT.row(0, result) == ("left", "0.123", "0.200", "0.050", "9 of 10")
    none = ball.BallResult("up", 0, 10, None, None, None)
    assert ball.EXPERIMENT.row(1, none) == ("up", "-", "-", "-", "0 of 10")
    (line,) = ball.EXPERIMENT.summarise([result], 1.0)
    assert line.startswith("published: offset 0.12")
    assert ball.BallOptions(step=10).angles == [0, 10, 20, 30]
