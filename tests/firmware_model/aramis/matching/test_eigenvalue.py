"""The quartic's largest root against the eigenvalues of Davenport's matrix in double precision."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.aramis.matching.identification import largest_eigenvalue, quartic
from cubestack.firmware_model.attitude.quest import quest

from ..sky import meter

Array = NDArray[np.float64]


def davenport(profile: Array) -> Array:
    odd = profile - profile.T
    z = np.array([[odd[1, 2], odd[2, 0], odd[0, 1]]])
    even = profile + profile.T - np.trace(profile) * np.eye(3)
    return np.block([[even, z.T], [z, np.trace(profile)]])


def unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def profile(rng: np.random.Generator, count: int, noise: float) -> Array:
    body = unit(rng.normal(size=(count, 3)))
    turned = unit(body + rng.normal(0, noise, body.shape))
    inertial = turned @ Rotation.random(random_state=rng).as_matrix()
    return np.asarray(body.T @ inertial / count)


def solutions(body: Array, inertial: Array) -> Array:
    """Quaternions by QUEST with the quartic, and with a root of 1."""
    arguments = [array.astype(np.float32) for array in (body, inertial, np.ones(len(body)))]
    return np.array([quest(*arguments, meter(), eigenvalue=e) for e in (largest_eigenvalue, None)])


@pytest.mark.parametrize("seed", range(50))
def test_the_quartic_is_the_characteristic_polynomial(seed: int) -> None:
    made = profile(np.random.default_rng(seed), 4, 0.5)
    square, linear, constant = quartic(made.astype(np.float32), meter())
    expected = np.poly(davenport(made))
    np.testing.assert_allclose([1, 0, square, linear, constant], expected, atol=2e-6)


@pytest.mark.parametrize("seed", range(50))
def test_contradicting_vectors_lower_the_root(seed: int) -> None:
    made = profile(np.random.default_rng(seed), 5, 0.3)
    expected = np.linalg.eigvalsh(davenport(made))[-1]
    assert expected < 0.999
    assert largest_eigenvalue(made.astype(np.float32), meter()) == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("seed", range(50))
def test_stars_of_one_field_leave_the_root_at_1(seed: int) -> None:
    """Their two largest roots are so close that a rounding error taken for a step would cost
    degrees of roll."""
    rng = np.random.default_rng(seed)
    body = unit(np.column_stack([rng.uniform(-0.13, 0.13, (3, 2)), np.ones(3)]))
    inertial = body @ Rotation.random(random_state=rng).as_matrix()
    body = unit(body + rng.normal(0, 4e-5, body.shape))
    made = (body.T @ inertial / 3).astype(np.float32)
    assert largest_eigenvalue(made, meter()) == 1
    np.testing.assert_array_equal(*solutions(body, inertial))


@pytest.mark.parametrize("seed", range(50))
def test_quest_with_the_quartic_solves_wahbas_problem(seed: int) -> None:
    """With vectors that agree within degrees, where a root of 1 would be wrong."""
    rng = np.random.default_rng(seed)
    body = unit(rng.normal(size=(6, 3)))
    inertial = body @ Rotation.random(random_state=rng).as_matrix()
    body = unit(body + rng.normal(0, 0.1, body.shape))
    best, _ = Rotation.align_vectors(body, inertial)
    found, plain = Rotation.from_quat(solutions(body, inertial)) * best.inv()
    assert found.magnitude() < min(5e-5, plain.magnitude())


def test_a_profile_of_nothing_ends() -> None:
    assert 0 <= largest_eigenvalue(np.zeros((3, 3), dtype=np.float32), meter()) <= 1
    assert not largest_eigenvalue(np.full((3, 3), np.nan, dtype=np.float32), meter()) > 1
