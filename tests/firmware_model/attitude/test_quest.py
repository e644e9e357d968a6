"""QUEST against the singular value decomposition, which solves Wahba's problem exactly."""

from collections import Counter
from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude.quest import AttitudeError, _determinant, dcm, quest
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from tests.together import together

Matrix = NDArray[np.float64]


def wahba(body: Matrix, inertial: Matrix, weights: Matrix) -> Matrix:
    u, _, vt = np.linalg.svd((body * weights[:, None]).T @ inertial)
    return np.asarray(u @ np.diag([1, 1, np.linalg.det(u) * np.linalg.det(vt)]) @ vt)


def in_field(rng: np.random.Generator, count: int) -> Matrix:
    body = np.column_stack(
        [rng.uniform(-0.45, 0.45, count), rng.uniform(-0.23, 0.23, count), np.ones(count)]
    )
    return np.asarray(body / np.linalg.norm(body, axis=1, keepdims=True))


def solve(body: Matrix, inertial: Matrix, weights: Matrix) -> NDArray[np.float32]:
    given = (one.astype(np.float32) for one in (body, inertial, weights))
    return quest(*given, Meter(CORTEX_M3))


def angle_deg(a: Matrix, b: Matrix) -> float:
    return float(np.degrees(Rotation.from_matrix(a @ b.T).magnitude()))


def attitude_of(quaternion: NDArray[np.float32]) -> Matrix:
    """Our convention is scipy's: the quaternion turns vectors."""
    return np.asarray(Rotation.from_quat(quaternion.astype(np.float64)).as_matrix())


@together("seed", range(200))
def test_quest_finds_the_optimal_attitude_of_noisy_vectors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 21))
    truth = Rotation.random(random_state=rng).as_matrix()
    body = in_field(rng, count)
    noisy = body + rng.normal(0, 1e-4, body.shape)
    noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
    weights = rng.integers(1, 20, count).astype(float)
    best = wahba(noisy, body @ truth, weights)
    found = solve(noisy, body @ truth, weights)
    spread = np.linalg.svd(body - body.mean(axis=0))[1][0] / np.sqrt(count)
    assert angle_deg(attitude_of(found), best) < 2e-4 / spread
    assert np.linalg.norm(found) == pytest.approx(1, abs=1e-6)
    assert found[3] >= 0


@together("off_deg", [0.0, 1e-6, 1e-3, 0.1, 2.0])
@together("seed", range(20))
def test_rotations_near_180_deg_lose_no_accuracy(off_deg: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3) if seed > 2 else np.eye(3)[seed]
    axis /= np.linalg.norm(axis)
    truth = Rotation.from_rotvec(axis * np.radians(180 - off_deg)).as_matrix()
    body = in_field(rng, 8)
    assert angle_deg(attitude_of(solve(body, body @ truth, np.ones(8))), truth) < 2e-3


def printed(body: Matrix, inertial: Matrix, meter: Meter) -> NDArray[np.float32]:
    given = (one.astype(np.float32) for one in (body, inertial, np.ones(len(body))))
    return quest(*given, meter, rotated=False)


def test_printed_equation_is_cheaper_and_right_far_from_180_deg() -> None:
    rotated, plain = Meter(CORTEX_M3), Meter(CORTEX_M3)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        turn = Rotation.from_rotvec(rng.uniform(-1, 1, 3)).as_matrix()
        body = in_field(rng, 12)
        assert angle_deg(attitude_of(printed(body, body @ turn, plain)), turn) < 2e-3
        quest(*(one.astype(np.float32) for one in (body, body @ turn, np.ones(12))), rotated)
    assert plain.total < 0.95 * rotated.total


def test_printed_equation_fails_near_180_deg() -> None:
    rng = np.random.default_rng(1)
    body = in_field(rng, 8)
    errors = []
    for off_deg in (10.0, 1.0, 0.1):
        turn = Rotation.from_rotvec(np.radians([0, 180 - off_deg, 0])).as_matrix()
        errors.append(angle_deg(attitude_of(printed(body, body @ turn, Meter(CORTEX_M3))), turn))
    assert max(errors[:2]) < 0.01
    assert errors[2] > 10 * errors[0]
    half = np.diag([-1.0, 1.0, -1.0])
    with pytest.raises(AttitudeError, match="singular"):
        printed(np.eye(3)[:2], np.eye(3)[:2] @ half, Meter(CORTEX_M3))


@together("seed", range(20))
def test_dcm_is_the_rotation_of_the_quaternion(seed: int) -> None:
    quaternion = Rotation.random(random_state=seed).as_quat().astype(np.float32)
    found = dcm(quaternion, Meter(CORTEX_M3))
    np.testing.assert_allclose(found, attitude_of(quaternion), atol=5e-7)


def test_two_stars_determine_the_attitude() -> None:
    truth = Rotation.random(random_state=5).as_matrix()
    body = in_field(np.random.default_rng(5), 2)
    assert angle_deg(attitude_of(solve(body, body @ truth, np.ones(2))), truth) < 2e-3


@pytest.mark.parametrize(
    ("body", "weights", "message"),
    [
        ([[0, 0, 1]], [1], "at least 2 vectors, not 1"),
        ([[0, 0, 1], [0, 0, 1]], [1, 1], "all point the same way"),
        ([[0, 0, 1], [0.6, 0, 0.8]], [0, 0], "add up to 0"),
    ],
)
def test_quest_rejects_vectors_that_determine_no_attitude(
    body: list[list[float]], weights: list[float], message: str
) -> None:
    with pytest.raises(AttitudeError, match=message):
        solve(np.array(body), np.array(body), np.array(weights, dtype=float))


def test_twenty_stars_take_less_than_ten_milliseconds() -> None:
    meter = Meter(CORTEX_M3)
    body = in_field(np.random.default_rng(6), 20).astype(np.float32)
    quest(body, body, np.ones(20, np.float32), meter)
    assert 0.0001 < CORTEX_M3.seconds(meter.total) < 0.010


class Counted(float):
    """A number that counts what is done to it."""

    done: ClassVar[Counter[str]] = Counter()

    def __mul__(self, other: float) -> "Counted":
        Counted.done["f32_mul"] += 1
        return Counted(float(self) * float(other))

    def __add__(self, other: float) -> "Counted":
        Counted.done["f32_add"] += 1
        return Counted(float(self) + float(other))

    def __sub__(self, other: float) -> "Counted":
        Counted.done["f32_add"] += 1
        return Counted(float(self) - float(other))


def test_determinant_charges_the_operations_it_performs() -> None:
    values = np.array([[2, 7, 6], [9, 5, 1], [4, 3, 8]])
    matrix = np.array([[Counted(value) for value in row] for row in values], dtype=object)
    meter = Meter(CORTEX_M3)
    Counted.done.clear()
    assert _determinant(matrix, meter) == pytest.approx(np.linalg.det(values))
    assert {name: meter.counts[name] for name in Counted.done} == Counted.done
    assert meter.counts["ram_read"] == 9


def test_each_star_costs_the_same() -> None:
    """An outer product of the weighted vector: 3 + 9 multiplications, 9 sums, and the weight's."""
    rng = np.random.default_rng(3)
    counts = []
    for stars in (4, 5, 20):
        meter = Meter(CORTEX_M3)
        body = in_field(rng, stars).astype(np.float32)
        quest(body, body, np.ones(stars, np.float32), meter)
        counts.append(meter.counts)
    four, five, twenty = counts
    assert five["f32_mul"] - four["f32_mul"] == 3 + 9
    assert five["f32_add"] - four["f32_add"] == 9 + 1
    for name in five:
        assert twenty[name] - four[name] == 16 * (five[name] - four[name])
