"""Area, moment and their noise against geometry in double precision and against dice."""

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.matching.triangles import Triangle, measure_triangle

from ..sky import meter

Array = NDArray[np.float64]


def in_field(rng: np.random.Generator, count: int = 1) -> Array:
    """Triples of unit vectors (count, 3, 3) in a field of 21 degrees."""
    points = rng.uniform(-0.13, 0.13, (count, 3, 2))
    vectors = np.concatenate([points, np.ones((count, 3, 1))], axis=2)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=2, keepdims=True))


def truth(corners: Array) -> tuple[Array, Array]:
    """Areas by the cross product, and moments as sums of squared distances over 36."""
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=-1) / 2
    squares = sum(np.sum((p - q) ** 2, axis=-1) for p, q in ((a, b), (b, c), (a, c)))
    return area, area * squares / 36


def measure(corners: Array, sigma: float = 1e-4) -> Triangle:
    return measure_triangle(corners.astype(np.float32), sigma, meter())


@pytest.mark.parametrize("seed", range(100))
def test_area_and_moment(seed: int) -> None:
    (corners,) = in_field(np.random.default_rng(seed))
    triangle = measure(corners)
    area, moment = truth(corners)
    assert triangle.area == pytest.approx(area, rel=1e-3, abs=1e-7)
    assert triangle.moment == pytest.approx(moment, rel=1e-3, abs=1e-9)


def test_the_moment_is_that_of_the_surface() -> None:
    """Second moment about the middle, over points spread evenly in the triangle."""
    corners = np.array([[0, 0, 1.0], [0.1, 0, 1], [0.03, 0.08, 1]])
    u, v = np.random.default_rng(1).uniform(size=(2, 400_000))
    fold = u + v > 1
    u[fold], v[fold] = 1 - u[fold], 1 - v[fold]
    points = (
        corners[0] + u[:, None] * (corners[1] - corners[0]) + v[:, None] * (corners[2] - corners[0])
    )
    area, moment = truth(corners)
    mean = np.mean(np.sum((points - corners.mean(axis=0)) ** 2, axis=1))
    assert area * mean == pytest.approx(moment, rel=0.01)


@pytest.mark.parametrize("seed", range(20))
def test_the_noise_is_that_of_dice(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sigma = 1e-4
    while True:
        (corners,) = in_field(rng)
        if truth(corners)[0] > 1e-3:  # far from a line, where no linear theory holds
            break
    noise = rng.normal(0, sigma, (20_000, 3, 3))
    noise -= np.sum(noise * corners, axis=2, keepdims=True) * corners
    thrown = corners + noise
    thrown /= np.linalg.norm(thrown, axis=2, keepdims=True)
    areas, moments = truth(thrown)
    triangle = measure(corners, sigma)
    assert triangle.area_sigma == pytest.approx(areas.std(), rel=0.04)
    assert triangle.moment_sigma == pytest.approx(moments.std(), rel=0.04)


@pytest.mark.parametrize("order", [(0, 2, 1), (1, 0, 2), (2, 1, 0), (1, 2, 0), (2, 0, 1)])
def test_the_order_of_stars_does_not_matter(order: tuple[int, ...]) -> None:
    (corners,) = in_field(np.random.default_rng(7))
    first, second = measure(corners), measure(corners[list(order)])
    for name in ("area", "moment", "area_sigma", "moment_sigma"):
        assert getattr(second, name) == pytest.approx(getattr(first, name), rel=1e-4)


def test_sides_are_in_the_order_of_the_equations() -> None:
    corners = np.array([[0, 0, 1.0], [0.1, 0, 1], [0, 0.2, 1]])
    sides = measure(corners).sides
    np.testing.assert_allclose(sides, [0.1, np.hypot(0.1, 0.2), 0.2], rtol=1e-5)


@pytest.mark.parametrize("corners", [np.zeros((3, 3)), np.eye(3)[[0, 0, 1]]])
def test_stars_on_a_line_give_no_triangle(corners: Array) -> None:
    assert measure_triangle(corners.astype(np.float32), 1e-4, meter()) is None


def test_a_triangle_costs_the_same_wherever_it_is() -> None:
    costs = set()
    for corners in in_field(np.random.default_rng(3), 10):
        spent = meter()
        measure_triangle(corners.astype(np.float32), 1e-4, spent)
        costs.add(spent.total)
    (cost,) = costs
    assert 5_000 < cost < 50_000
