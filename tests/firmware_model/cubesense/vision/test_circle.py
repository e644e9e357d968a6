import numpy as np
import pytest
from scipy.optimize import least_squares

from cubestack.firmware_model.cubesense.vision.circle import Circle, LeastSquaresCircle
from cubestack.firmware_model.mcu.costs import Meter


def on_circle(rng: np.random.Generator, count: int, spread: float = 6.3) -> np.ndarray:
    turn = rng.uniform(0, spread, count)
    centre, radius = rng.uniform(-100, 100, 2), rng.uniform(50, 180)
    points = centre + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.concatenate([points, [[*centre]], [[radius, 0]]])


@pytest.mark.parametrize("seed", range(20))
def test_points_on_a_circle_give_it_back(meter: Meter, seed: int) -> None:
    data = on_circle(np.random.default_rng(seed), 20)
    circle = LeastSquaresCircle(data[:20].astype(np.float32), meter).solve()
    assert [circle.x, circle.y] == pytest.approx(data[20].tolist(), abs=0.01)
    assert circle.radius == pytest.approx(data[21, 0], abs=0.01)


@pytest.mark.parametrize("seed", range(10))
def test_the_fit_minimises_the_algebraic_error(meter: Meter, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = on_circle(rng, 12)[:12] + rng.normal(0, 2, (12, 2))
    circle = LeastSquaresCircle(points.astype(np.float32), meter).solve()

    def error(c: np.ndarray) -> np.ndarray:
        return (points**2).sum(axis=1) + 2 * points @ c[:2] + c[2]

    best = least_squares(error, np.zeros(3), x_scale=[100, 100, 1e4], xtol=1e-14, ftol=1e-14).x
    assert [circle.x, circle.y] == pytest.approx((-best[:2]).tolist(), abs=0.02)
    assert circle.power == pytest.approx(best[2], rel=1e-3, abs=5)


def test_removing_a_point_equals_never_adding_it(meter: Meter) -> None:
    rng = np.random.default_rng(7)
    points = (on_circle(rng, 15)[:15] + rng.normal(0, 1, (15, 2))).astype(np.float32)
    equations = LeastSquaresCircle(points, meter)
    equations.remove(points[4])
    kept = LeastSquaresCircle(np.delete(points, 4, axis=0), meter).solve()
    taken = equations.solve()
    assert [taken.x, taken.y, taken.radius] == pytest.approx(
        [kept.x, kept.y, kept.radius], abs=0.02
    )


@pytest.mark.parametrize("count", [0, 1, 2])
def test_rejects_too_few_points(meter: Meter, count: int) -> None:
    assert LeastSquaresCircle(np.ones((count, 2), np.float32), meter).solve() is None


def test_rejects_collinear_points(meter: Meter) -> None:
    points = np.array([[x, 2 * x + 3] for x in range(-100, 100, 13)], np.float32)
    assert LeastSquaresCircle(points, meter).solve() is None
    assert LeastSquaresCircle(np.full((9, 2), 50, np.float32), meter).solve() is None
    upright = np.array([[1, 0], [1, 5], [1, 9]], np.float32)
    assert LeastSquaresCircle(upright, meter).solve() is None


def test_residuals_are_distances_from_the_circle(meter: Meter) -> None:
    circle = Circle(np.float32(10), np.float32(-20), np.float32(150))
    turn = np.linspace(0, 6, 30)
    outside = np.linspace(-2, 2, 30)
    radius = 150 + outside
    points = np.stack([10 + radius * np.cos(turn), -20 + radius * np.sin(turn)], axis=1)
    assert circle.residuals(points.astype(np.float32), meter) == pytest.approx(outside, abs=0.02)
