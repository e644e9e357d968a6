import re
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.fisheye import DISTORTION
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.host.studies.aramis import fidelity as aramis
from cubestack.host.studies.cubesense import fidelity as cubesense
from cubestack.host.studies.cubesense.fidelity import _lens
from cubestack.host.studies.cubestar import fidelity as cubestar
from cubestack.host.studies.cubestar.shots import Shot
from cubestack.host.studies.fidelity.table import Job, fidelity_of, perform

# --- sums over results ----------------------------------------------------------------------------


def shot(detected: int, matched: int, wrong: int = 0, **more: Any) -> Shot:
    usual = {"valid": True, "right": True, "tracked": False, "cross_deg": 0.01}
    return Shot(**usual | more, detected=detected, matched=matched, wrong=wrong)


def test_field_rates_count_right_and_wrong_attitudes(monkeypatch: pytest.MonkeyPatch) -> None:
    shots = [shot(10, 10), shot(10, 5, 2), shot(8, 4, 2, right=False)]
    shots += [shot(*stars, valid=False, right=False) for stars in ((5, 2), (0, 0))]
    monkeypatch.setattr(cubestar, "field_shots", lambda _opened, frames, **_: shots[:frames])
    found = cubestar._field(None, 5)  # type: ignore[arg-type]
    assert found == {
        "three": pytest.approx(40.0),
        "right": pytest.approx(40.0),
        "star_wrong": pytest.approx(40.0),
        "off": pytest.approx(20.0),
        "share": pytest.approx(100 * (1 + 0.3 + 0.25 + 0.4 + 0) / 5),
    }


def test_tracked_share_excludes_the_first_frame_of_a_sky(monkeypatch: pytest.MonkeyPatch) -> None:
    one = [shot(10, 8), *[shot(10, 10, tracked=True, cross_deg=0.03)] * 6, *[shot(10, 7)] * 3]
    two = [shot(0, 0, valid=False, right=False, cross_deg=np.nan)] * 2
    two += [shot(6, 6, right=False, cross_deg=0.5)]
    monkeypatch.setattr(cubestar, "slewing_shots", lambda *_: [(s, None) for s in one + two])
    found = cubestar._slew(None, 13, 0.3)  # type: ignore[arg-type]
    assert found["right"] == pytest.approx(100 * 10 / 13)
    assert found["tracked"] == pytest.approx(100 * 6 / 11)
    assert found["off"] == pytest.approx(100 / 13)
    assert found["share"] == pytest.approx(100 * (8 + 60 + 21 + 6) / 106)
    assert found["cross"] == 0.03
    monkeypatch.setattr(cubestar, "slewing_shots", lambda *_: [(s, None) for s in two[:2]])
    found = cubestar._slew(None, 2, 8.0)  # type: ignore[arg-type]
    assert found["share"] == 0
    assert np.isnan(found["cross"])


def attitude(cross: float, roll: float = 0.0, **more: Any) -> SimpleNamespace:
    usual: dict[str, Any] = {"right": True, "solved": True, "centroids": 10, "phase_ms": {}}
    return SimpleNamespace(error_cross_deg=cross, error_roll_deg=roll, **usual | more)


def test_cubestar_fidelity_uses_right_attitudes_and_times_of_full_images() -> None:
    times = {"detect": 100.0, "match": 20.0, "attitude": 5.0}
    results = [attitude(0.001 * n, -0.002 * n) for n in range(101)]
    results += [attitude(3.0, 2.0, right=False), attitude(9.0, right=False, solved=False)]
    results += [attitude(0.05, 0.1, centroids=20, phase_ms=times)]
    results += [attitude(0.05, 0.1, centroids=30, phase_ms=dict.fromkeys(times, 40.0))]
    results += [attitude(0.05, 0.1, centroids=19, phase_ms=dict.fromkeys(times, 999.0))]
    found = cubestar._attitudes(results)  # type: ignore[arg-type]
    right = [one for one in results if one.right]
    assert found["right"] == pytest.approx(100 * 104 / 106)
    assert found["off"] == pytest.approx(100 / 106)
    assert (found["cross_worst"], found["roll_worst"]) == pytest.approx((0.1, 0.2))
    assert found["cross95"] == pytest.approx(np.quantile([r.error_cross_deg for r in right], 0.95))
    rolls = [abs(one.error_roll_deg) for one in right]
    assert found["roll95"] == pytest.approx(np.quantile(rolls, 0.95))
    assert (found["algorithms_ms"], found["match_ms"], found["quest_ms"]) == (120, 40, 40)


SHARES = {"right", "off", "wrong", "far", "conclusive", "ambiguous", "none"}


@pytest.mark.parametrize("module", [cubestar, aramis])
def test_fidelity_errors_are_nan_without_right_attitudes(module: Any) -> None:
    more = {"far": None, "outcome": "none"} if module is aramis else {}
    found = module._attitudes([attitude(3.0, right=False, solved=module is cubestar, **more)])
    assert (found["right"], found["off" if module is cubestar else "none"]) == (0, 100)
    assert len(found.keys() - SHARES) >= 3
    assert all(np.isnan(found[name]) for name in found.keys() - SHARES)


def test_aramis_errors_are_in_arcsec_and_outcomes_are_counted() -> None:
    results = [attitude(n / 3600, -2 * n / 3600, far=False, outcome="unique") for n in range(10)]
    results += [attitude(1.0, right=False, far=True, outcome="unique")]
    for ending in ("ambiguous", "ambiguous", "none"):
        results += [attitude(1.0, right=False, solved=False, far=None, outcome=ending)]
    found = aramis._attitudes(results)  # type: ignore[arg-type]
    of = len(results) / 100
    shares = {"right": 10, "wrong": 1, "far": 1, "conclusive": 11, "ambiguous": 2, "none": 1}
    expected = {name: count / of for name, count in shares.items()}
    assert {name: found[name] for name in shares} == pytest.approx(expected)
    assert found["cross"] == pytest.approx(4.5)
    assert found["cross95"] == pytest.approx(np.quantile(range(10), 0.95))
    assert found["roll95"] == pytest.approx(np.quantile(range(0, 20, 2), 0.95))


def test_cubesense_fidelity_figures_are_computed_per_axis_and_band() -> None:
    rng = np.random.default_rng(5)
    truth, off = rng.uniform(-70, 70, (60, 2)), rng.normal(0.1, 0.3, (60, 2))
    phases = {"wait": 10.0, "store": 20.0, "total": 50.0}
    results = [
        SimpleNamespace(
            detected=True,
            error_deg=float(np.hypot(*away)),
            **dict(zip(("truth_alpha_deg", "truth_beta_deg"), true, strict=True)),
            **dict(zip(("alpha_deg", "beta_deg"), true + away, strict=True)),
            edges=100 + number if number else None,
            phase_ms={name: value + number for name, value in phases.items()},
        )
        for number, (true, away) in enumerate(zip(truth, off, strict=True))
    ]
    unseen = SimpleNamespace(detected=False, error_deg=None)
    unknown = SimpleNamespace(detected=True, error_deg=None)
    found = cubesense._sensor([*results, unseen, unknown, unseen, unseen])  # type: ignore[list-item]
    for axis, name in enumerate(("alpha", "beta")):
        assert found[name] == pytest.approx(np.mean(np.abs(off[:, axis])))
        assert found[f"sigma_{name}"] == pytest.approx(np.std(off[:, axis]))
        assert found[f"sum_{name}"] == pytest.approx(found[name] + found[f"sigma_{name}"])
    size, angle = np.hypot(*off.T), np.hypot(*truth.T)
    assert (found["mean"], found["worst"]) == pytest.approx((size.mean(), size.max()))
    assert found["p95"] == pytest.approx(np.quantile(size, 0.95))
    assert found["detected"] == pytest.approx(100 * 60 / 64)
    assert (found["least_edges"], found["most_edges"]) == (0, 159)
    for name, low, high in (("30", 0, 30), ("40", 0, 40), ("45", 0, 45), ("60", 40, 60)):
        own = size[(low <= angle) & (angle < high)]
        assert found[f"mean_{name}"] == pytest.approx(own.mean())
        assert found[f"worst_{name}"] == pytest.approx(own.max())
    inner = off[angle < 30]
    both = [np.abs(inner[:, axis]).mean() + inner[:, axis].std() for axis in (0, 1)]
    assert found["sum_30"] == pytest.approx(max(both))
    assert (found["wait_ms"], found["total_ms"]) == pytest.approx((39.5, 79.5))
    assert found["imaging_ms"] == pytest.approx(39.5 + 49.5)
    assert found["sigma_ms"] == pytest.approx(np.std(range(60)))


def test_fidelity_reports_the_worst_sun_error_at_90_degrees() -> None:
    one = {"alpha_deg": 90.05, "beta_deg": 0.0, "error_deg": 0.05, "edges": None, "detected": True}
    truth = {"truth_alpha_deg": 90.0, "truth_beta_deg": 0.0}
    times = {"phase_ms": {"wait": 1.0, "store": 1.0, "total": 2.0}}
    inner = one | truth | {"truth_alpha_deg": 1.0, "alpha_deg": 1.01, "error_deg": 0.01} | times
    results: list[Any] = [SimpleNamespace(**one, **truth, **times), SimpleNamespace(**inner)]
    found = cubesense._sensor(results)
    assert found["worst_90"] == 0.05
    assert found["worst_rest"] == 0.05
    assert found["worst_30"] == 0.01
    assert np.isnan(found["mean_60"])
    behind = one | {"truth_alpha_deg": 90.5, "truth_beta_deg": 0.0} | times
    found = cubesense._sensor([SimpleNamespace(**behind), results[1]])
    assert found["worst"] == 0.05
    assert np.isnan(found["worst_90"])
    assert np.isnan(found["worst_rest"])


def test_sun_repeatability_is_measured_at_the_angles_of_its_row(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[float] = []

    def found_at(_device: str, *, frames: int, scene: Any, **_: Any) -> list[SimpleNamespace]:
        angle = scene.truth(CameraTarget.SUN, 0, 100.0).alpha_deg
        seen.append(angle)
        off = angle / 1000 * np.resize([1, -1], frames)
        return [SimpleNamespace(alpha_deg=angle, beta_deg=one) for one in off]

    monkeypatch.setattr(cubesense, "measure", found_at)
    wanted = fidelity_of("cubesense")
    (row,) = [one for one in wanted.rows if one.trial == "sun-still"]
    found = wanted.trials["sun-still"].run(SimpleNamespace(board={}), 6)
    named = [float(number) for number in re.findall(r"\d+", row.figure)]
    assert seen == pytest.approx(named, abs=1e-6)
    assert found == {"sigma": pytest.approx(max(named) / 1000)}


# --- a few frames of what is measured -------------------------------------------------------------

compiled = pytest.mark.skipif(find_compiler() is None, reason="needs the compiled FPGA")


@compiled
def test_centroid_errors_are_below_0_01_px() -> None:
    found = perform(Job("cubestar", "centroids", "extended", 1, 1.0))
    assert 0 < found["x"] < 0.01
    assert 0 < found["y"] < 0.01


@compiled
def test_spot_sizes_are_within_their_limits() -> None:
    found = perform(Job("cubestar", "spots", "published", 1, 1.0))
    assert 8 <= found["low"] < found["middle"] < found["high"] <= 40


@compiled
def test_loop_has_the_published_times() -> None:
    found = perform(Job("cubestar", "loop", "published", 2, 1.0))
    parts = ("discard", "capture", "transfer", "detect", "match", "attitude")
    assert sum(found[part] for part in parts) < found["loop_total"] + 200
    assert found["idle"] + found["loop_total"] == pytest.approx(1000, abs=3)
    assert found["mw"] == pytest.approx(396, rel=0.03)
    # An attitude is what was in the middle of the exposure, until the next one a second later.
    assert found["oldest"] - found["age"] == pytest.approx(1000, abs=10)
    assert found["loop_total"] < found["age"] + 300 < 1500


@compiled
@pytest.mark.parametrize(("name", "least"), [("v3.8-exact", 90), ("false1-lis", 60)])
def test_published_field_is_identified(name: str, least: float) -> None:
    found = perform(Job("cubestar", name, "extended", 2, 1.0))
    assert (found["three"], found["right"], found["star_wrong"], found["off"]) == (100, 100, 0, 0)
    assert found["share"] > least
    assert (found["share"] < 100) == name.startswith("false")


@compiled
def test_slow_slew_is_tracked_and_fast_slew_is_lost() -> None:
    slow = perform(Job("cubestar", "slew-0.0635", "extended", 3, 1.0))
    assert (slow["right"], slow["tracked"]) == (100, 100)
    assert slow["cross"] < 0.01
    fast = perform(Job("cubestar", "slew-8.0", "extended", 1, 1.0))
    assert fast["right"] == fast["off"] == 0


@compiled
def test_ball_is_seen_where_the_stage_moved_it() -> None:
    found = perform(Job("cubesense", "ball", "published", 1, 1.0))
    for direction in ("right", "left", "down", "up"):
        assert 0 < found[direction] < 0.5
    assert 0 <= found["sigma"] < 0.3
    assert np.isfinite(list(found.values())).all()


def test_discriminant_matches_the_roots_of_the_polynomial() -> None:
    nothing: Any = None
    differences = [one - other for one, other in combinations(np.roots(DISTORTION), 2)]
    expected = DISTORTION[0] ** 4 * np.prod(differences) ** 2
    assert _lens(nothing, 0)["discriminant"] == pytest.approx(expected.real, rel=1e-10, abs=0)
