import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.emulator.scene.attitude import (
    matrix_from_quaternion,
    propagate,
    quaternion_from_pointing,
)
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.firmware_model.interface.cubestar.codes import Reason
from cubestack.host.clients.quaternions import AttitudeQuality, common
from cubestack.host.experiments.attitude import (
    axis_errors_deg,
    claims,
    compare,
    count_wrong,
    is_right,
    percentile_95,
    rough_boresight,
)

TRUTH = quaternion_from_pointing(84.0, -1.0, 20.0)


@pytest.mark.parametrize(
    ("cross", "roll", "right"),
    [
        *((0.0999, 0.2999, True), (0.0999, -0.2999, True), (0.1, 0.0, False)),
        *((0.0, 0.3, False), (0.0, -0.3, False)),
    ],
)
def test_attitude_is_right_within_0_1_deg_across_and_0_3_deg_roll(
    cross: float, roll: float, right: bool
) -> None:
    assert is_right(cross, roll) is right


def test_comparison_without_truth_or_solution_has_no_error() -> None:
    both, lost, blind = compare(TRUTH, TRUTH), compare(None, TRUTH), compare(TRUTH, None)
    assert (both["solved"], both["right"], both["quaternion"]) == (True, True, TRUTH.tolist())
    assert (lost["solved"], lost["right"], lost["quaternion"]) == (False, False, None)
    assert (blind["solved"], blind["right"], blind["error_cross_deg"]) == (True, None, None)


@pytest.mark.slow
def test_hints_are_uniform_within_their_angle() -> None:
    rng = np.random.default_rng(3)
    boresight = matrix_from_quaternion(TRUTH)[2]
    hints = np.array([rough_boresight(TRUTH, 5.0, rng) for _ in range(2000)])
    away = np.degrees(np.arccos(hints @ boresight))
    assert away.max() <= 5.0
    assert np.mean(away < 5.0 / np.sqrt(2)) == pytest.approx(0.5, abs=0.04)
    assert np.linalg.norm(hints.mean(axis=0)) > 0.998


def test_counts_wrongly_identified_stars() -> None:
    sky = load_sky()
    numbers = [int(number) for number in sky.hip[[10, 20, 30]]]
    seen = 3.0 * sky.vectors[[10, 20, 30]] @ matrix_from_quaternion(TRUTH).T
    assert count_wrong(numbers, seen, TRUTH) == 0
    assert count_wrong(numbers, seen[[0, 2, 1]], TRUTH) == 2
    assert count_wrong([], np.empty((0, 3)), TRUTH) == 0


@pytest.mark.parametrize("degrees", [0.0, 1e-5, 1.0, 89.9, 90.1, 168.0, 179.999])
def test_axis_errors_are_a_rotation_vector_at_any_angle(degrees: float) -> None:
    axes = np.random.default_rng(5).normal(size=(20, 3))
    for axis in axes / np.linalg.norm(axes, axis=1)[:, None]:
        turned = propagate(TRUTH, tuple(degrees * axis), 1.0)
        true, measured = matrix_from_quaternion(TRUTH), matrix_from_quaternion(turned)
        expected = Rotation.from_matrix(true @ measured.T).as_rotvec(degrees=True)
        assert axis_errors_deg(turned, TRUTH) == pytest.approx(expected, rel=1e-6, abs=1e-9)
        assert np.linalg.norm(expected) == pytest.approx(degrees, rel=1e-6, abs=1e-9)


def test_axis_errors_of_a_half_turn_add_up_to_180_deg() -> None:
    found = axis_errors_deg(np.array([1.0, 0, 0, 0]), np.array([0, 0, 0, 1.0]))
    assert np.linalg.norm(found) == pytest.approx(180)


def test_sigma_is_compared_with_errors_only_with_truth_and_quality() -> None:
    values = dict.fromkeys(("CorrelationXY", "CorrelationXZ", "CorrelationYZ"), 0.0)
    values |= {f"Sigma{axis}": np.radians(n) for n, axis in enumerate("XYZ", 1)}
    names = ("Matched", "Expected", "Residual", "Background", "Noise", "Spikes")
    values |= dict.fromkeys(names, 1.0)
    found = common({**values, "Valid": True, "Scale": 1.0, "LogFalseAlarm": -9.0})
    rated = AttitudeQuality(reason=Reason.SOLVED, **found)
    assert rated.false_alarm == pytest.approx(1e-9)
    both = claims(rated, TRUTH, TRUTH)
    assert both["sigma_deg"] == pytest.approx([1, 2, 3])
    assert both["error_deg"] == pytest.approx([0, 0, 0], abs=1e-12)
    assert claims(rated, None, TRUTH) == dict.fromkeys(both)
    assert claims(None, TRUTH, None) == dict.fromkeys(both)


def test_percentile_ignores_the_sign() -> None:
    assert percentile_95(iter([-100.0, None, 0.0, -100.0])) == pytest.approx(100.0)
    assert percentile_95(iter([None, None])) is None
    assert percentile_95(iter([-1.0, None, 0.0])) == pytest.approx(0.95)
