"""The methods against NumPy's own decompositions, in double precision, and in special cases."""

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.attitude import arithmetic, methods
from cubestack.host.studies.compare.attitude.run import errors_deg, run
from cubestack.host.studies.compare.attitude.smoothing import smooth
from cubestack.host.studies.compare.attitude.trials import CASES, FRAMES, STEP_S, take_trial
from cubestack.host.studies.compare.database import Catalogue
from cubestack.host.studies.compare.tracker import Tracker
from tests.together import together

Vectors = NDArray[np.float64]

SOLVERS = {method.name: method.solve for method in methods.methods()}
OPTIMAL = ("q-method", "QUEST, eigenvalue 1", "QUEST, quartic", "SVD")
IN_DOUBLE = ("TRIAD", "q-method", "QUEST as printed", "SVD", "plain DCM", "orthogonal DCM")


def _meter() -> Meter:
    return Meter(CORTEX_M3)


def _rotation(rng: np.random.Generator) -> Vectors:
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return np.asarray(turn * np.linalg.det(turn))


def _stars(rng: np.random.Generator, count: int, spread: float, noise: float) -> list[Vectors]:
    """Measured and listed directions, and the attitude."""
    attitude = _rotation(rng)
    ahead = np.column_stack([rng.uniform(-spread, spread, (count, 2)), np.ones(count)])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    measured = ahead + noise * rng.normal(size=ahead.shape)
    measured /= np.linalg.norm(measured, axis=1, keepdims=True)
    return [measured, ahead @ attitude, attitude]


def _optimum(measured: Vectors, listed: Vectors) -> Vectors:
    """Wahba's problem by NumPy's singular values."""
    u, _, v = np.linalg.svd(measured.T @ listed)
    return np.asarray(u @ np.diag([1, 1, np.linalg.det(u) * np.linalg.det(v)]) @ v)


def _davenport(measured: Vectors, listed: Vectors) -> Vectors:
    """The same by NumPy's eigenvectors of K, from products of quaternions instead of equation 6.5:
    q' K q is the sum of b . A(q) r for A of every product of two components."""
    b = measured.T @ listed
    k = np.zeros((4, 4))
    units = np.eye(4)
    for i in range(4):
        for j in range(4):
            both, left, right = (_of(q) for q in (units[i] + units[j], units[i], units[j]))
            k[i, j] = ((both - left - right) * b).sum() / 2
    return _of(np.linalg.eigh(k)[1][:, -1])


def _of(q: Vectors) -> Vectors:
    v, w = q[:3], q[3]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.asarray((w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) + 2 * w * cross)


def test_oracles_agree_with_each_other() -> None:
    measured, listed, _ = _stars(np.random.default_rng(1), 8, 0.3, 1e-3)
    assert _davenport(measured, listed) == pytest.approx(_optimum(measured, listed), abs=1e-9)


@pytest.mark.parametrize("name", IN_DOUBLE)
@pytest.mark.parametrize("spread", [0.05, 0.4])
def test_exact_directions_give_the_exact_attitude(name: str, spread: float) -> None:
    measured, listed, attitude = _stars(np.random.default_rng(2), 6, spread, 0.0)
    found = SOLVERS[name](measured, listed, _meter())
    assert found == pytest.approx(attitude, abs=1e-9)


@together("name", ["q-method", "SVD"])
@together("seed", range(10))
def test_optimal_methods_are_the_optimum_in_double_precision(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    measured, listed, _ = _stars(rng, int(rng.integers(2, 12)), rng.uniform(0.05, 0.5), 1e-3)
    found = SOLVERS[name](measured, listed, _meter())
    assert found == pytest.approx(_optimum(measured, listed), abs=1e-8)


@together("name", OPTIMAL)
@together("seed", range(10))
def test_optimal_methods_agree_within_single_precision(name: str, seed: int) -> None:
    measured, listed, _ = _stars(np.random.default_rng(seed), 6, 0.2, 1e-4)
    found = SOLVERS[name](measured.astype(np.float32), listed.astype(np.float32), _meter())
    assert found == pytest.approx(_optimum(measured, listed), abs=2e-5)


def test_plain_dcm_is_the_least_squares_solution_and_no_rotation() -> None:
    measured, listed, _ = _stars(np.random.default_rng(3), 8, 0.3, 1e-3)
    found = SOLVERS["plain DCM"](measured, listed, _meter())
    assert found == pytest.approx(np.linalg.lstsq(listed, measured, rcond=None)[0].T, abs=1e-9)
    assert found is not None
    assert np.abs(found @ found.T - np.eye(3)).max() > 1e-4


def test_orthogonal_dcm_is_the_nearest_rotation_to_the_plain_one() -> None:
    measured, listed, _ = _stars(np.random.default_rng(3), 8, 0.3, 1e-3)
    plain, found = (
        SOLVERS[f"{kind} DCM"](measured, listed, _meter()) for kind in ("plain", "orthogonal")
    )
    assert plain is not None
    u, _, v = np.linalg.svd(plain)
    assert found == pytest.approx(u @ v, abs=1e-12)


def test_triad_keeps_the_first_star() -> None:
    measured, listed, _ = _stars(np.random.default_rng(4), 2, 0.3, 1e-2)
    found = SOLVERS["TRIAD"](measured, listed, _meter())
    assert found is not None
    assert found @ listed[0] == pytest.approx(measured[0], abs=1e-12)


@pytest.mark.parametrize("name", [*OPTIMAL, "TRIAD"])
def test_half_turns_are_solved(name: str) -> None:
    rng = np.random.default_rng(5)
    for axis in (*np.eye(3), *rng.normal(size=(5, 3))):
        about = axis / np.linalg.norm(axis)
        attitude = 2 * np.outer(about, about) - np.eye(3)
        measured, listed, turn = _stars(rng, 5, 0.3, 0.0)
        listed = listed @ (attitude.T @ turn).T
        found = SOLVERS[name](measured.astype(np.float32), listed.astype(np.float32), _meter())
        assert found == pytest.approx(attitude, abs=1e-5)


def test_quest_as_printed_fails_at_half_turns() -> None:
    rng = np.random.default_rng(5)
    measured, listed, turn = _stars(rng, 5, 0.3, 1e-5)
    listed = listed @ (np.diag([-1.0, 1, -1]) @ turn).T
    given = measured.astype(np.float32), listed.astype(np.float32)
    found = SOLVERS[methods.PRINTED](*given, _meter())
    assert found is None or np.abs(found - np.diag([-1, 1, -1])).max() > 0.01


@pytest.mark.parametrize("name", SOLVERS)
def test_two_stars_in_one_place_are_refused_or_far_from_sure(name: str) -> None:
    ray = np.array([[0.1, 0.2, 0.97]] * 2, np.float32)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    found = SOLVERS[name](ray, ray, _meter())
    if name == "q-method":  # any rotation about the star has the largest eigenvalue
        assert found is not None
        assert found @ ray[0] == pytest.approx(ray[0], abs=1e-5)
    else:
        assert found is None


@pytest.mark.parametrize("name", ["plain DCM", "orthogonal DCM"])
def test_two_stars_are_too_few_for_nine_elements(name: str) -> None:
    measured, listed, _ = _stars(np.random.default_rng(6), 2, 0.3, 0.0)
    assert SOLVERS[name](measured, listed, _meter()) is None


@pytest.mark.parametrize("size", [3, 4, 6])
def test_arithmetic_matches_numpy(size: int) -> None:
    rng = np.random.default_rng(size)
    a = rng.normal(size=(size, size))
    symmetric = a + a.T
    assert arithmetic.inverse(a, _meter()) == pytest.approx(np.linalg.inv(a), abs=1e-9)
    values, vectors = arithmetic.eigenvectors(symmetric, _meter())
    assert np.sort(values) == pytest.approx(np.linalg.eigvalsh(symmetric), abs=1e-9)
    assert symmetric @ vectors == pytest.approx(vectors * values, abs=1e-9)
    left, right = arithmetic.orthogonal_columns(a, _meter())
    assert left == pytest.approx(a @ right, abs=1e-9)
    lengths = np.linalg.norm(left, axis=0)
    assert lengths == pytest.approx(np.linalg.svd(a)[1], abs=1e-9)
    assert arithmetic.inverse(np.ones((size, size)), _meter()) is None


# --- trials ---------------------------------------------------------------------------------------


def test_filter_errors_are_those_of_a_line_through_the_images(star_tracker: Tracker) -> None:
    """The end of a line through n values with error s has s sqrt((4n - 2) / (n (n + 1)))."""
    errors = {"one": list[float](), "all": list[float]()}
    for number in range(40):
        trial = take_trial(star_tracker, CASES[0], 8, number)
        assert trial is not None
        for name, frames in (("one", trial.frames[-1:]), ("all", trial.frames)):
            found = smooth(frames, trial.listed, trial.sigma_rad, STEP_S, _meter())
            assert found is not None
            errors[name].append(errors_deg(found, trial.truth)[0])
    one, every = (np.sqrt(np.mean(np.square(values))) for values in errors.values())
    expected = np.sqrt((4 * FRAMES - 2) / (FRAMES * (FRAMES + 1)))
    assert every / one == pytest.approx(expected, rel=0.25)


def test_attitudes_follow_from_the_seed(cubestar: Catalogue) -> None:
    one, same, other = (list(run(cubestar.tracker, 2, seed)) for seed in (1, 1, 2))
    assert one == same
    assert one != other


def test_errors_are_measured_about_the_cameras_axes() -> None:
    turn = np.radians(0.2)
    roll = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    cross = roll[[2, 0, 1]][:, [2, 0, 1]]
    assert errors_deg(roll, np.eye(3)) == pytest.approx((0, 0.2), abs=1e-6)
    assert errors_deg(cross, np.eye(3)) == pytest.approx((0.2, 0), abs=1e-6)
