"""The circle, and the limb with its uncertainty, beside least squares of another library."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from cubestack.firmware_model.cubesense.vision.arithmetic import sequential_sum, to_int16
from cubestack.firmware_model.cubesense.vision.circle import Circle, LeastSquaresCircle
from cubestack.firmware_model.cubesense.vision.limb import Limb, Tolerances, find_limb
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20


def on_circle(rng: np.random.Generator, count: int, spread: float = 6.3) -> np.ndarray:
    turn = rng.uniform(0, spread, count)
    centre, radius = rng.uniform(-100, 100, 2), rng.uniform(50, 180)
    points = centre + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.concatenate([points, [[*centre]], [[radius, 0]]])


@pytest.mark.parametrize("seed", range(20))
def test_circle_fit_recovers_the_circle(meter: Meter, seed: int) -> None:
    data = on_circle(np.random.default_rng(seed), 20)
    circle = LeastSquaresCircle(data[:20].astype(np.float32), meter).solve()
    assert [circle.x, circle.y] == pytest.approx(data[20].tolist(), abs=0.01)
    assert circle.radius == pytest.approx(data[21, 0], abs=0.01)


@pytest.mark.parametrize("seed", range(10))
def test_circle_fit_minimises_the_algebraic_error(meter: Meter, seed: int) -> None:
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


ALLOWED = Tolerances(on_px=4.0, good_rms_px=1.0, usual_px=0.3)
TANGENTS = (0.5, 5.0, 166.0)
TRUE = (10.0, -20.0, 120.0)

Points = NDArray[np.float64]


def circle(count: int, noise_px: float = 0.0, arc_deg: float = 360.0) -> Points:
    rng = np.random.default_rng(count)
    turn = np.radians(np.linspace(20, 20 + arc_deg, count, endpoint=False))
    radius = TRUE[2] + noise_px * rng.standard_normal(count)
    return np.array(TRUE[:2]) + radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])


def found(points: Points, moved: int = 0, allowed: Tolerances = ALLOWED) -> Limb:
    """The limb among points, of which the last ``moved`` are far off."""
    points = points.copy()
    points[len(points) - moved :] += np.array([[30, 5], [-40, 20], [10, -50]])[:moved]
    inwards = np.sign(np.array(TRUE[:2]) - points)
    sides = np.where(np.arange(2) == (np.arange(len(points)) % 2)[:, None], inwards, 0)
    limb = find_limb(
        points.astype(np.float32), sides.astype(np.int8), allowed, TANGENTS, Meter(PIC18F45K20)
    )
    assert limb is not None
    return limb


def jacobian(points: Points) -> tuple[Points, Points]:
    """Of the best circle's distances, and the circle."""

    def distances(x: Points) -> Points:
        return np.asarray(np.hypot(*(points - x[:2]).T) - x[2])

    best = least_squares(distances, TRUE)
    return np.asarray(best.jac), np.asarray(best.x)


@pytest.mark.parametrize("arc_deg", [360.0, 150.0])
@pytest.mark.parametrize("count", [5, 12, 28])
def test_limb_fit_is_the_least_squares_circle(count: int, arc_deg: float) -> None:
    points = circle(count, 0.3, arc_deg)
    limb = found(points)
    _, best = jacobian(points)
    assert [limb.circle.x, limb.circle.y, limb.circle.radius] == pytest.approx(best, abs=0.05)
    assert limb.on_circle == count


@pytest.mark.parametrize(
    ("count", "variance"),
    [
        # 6 usual edges and those above 3 without a residual; few of them hide a false one.
        (4, 6 / 7 * (1 + 8 / 1)),
        (5, 6 / 8 * (1 + 10 / 4)),
        (7, 6 / 10 * (1 + 14 / 16)),
        (20, 6 / 23 * (1 + 40 / 289)),
    ],
)
def test_limb_variance_with_few_edges_includes_prior_edges(count: int, variance: float) -> None:
    points = circle(count)
    limb = found(points)
    jac, _ = jacobian(points)
    expected = variance * ALLOWED.usual_px**2 * np.linalg.inv(jac.T @ jac)
    assert limb.covariance == pytest.approx(expected, rel=0.01, abs=1e-5)
    assert limb.rms_px < 0.01


def test_limb_fit_covariance_grows_with_excluded_edges_and_residuals() -> None:
    whole, parts = (found(circle(20), moved) for moved in (0, 3))
    assert parts.on.tolist() == [True] * 17 + [False] * 3
    rest = found(circle(20)[:17])
    assert parts.covariance == pytest.approx((20 / 17) ** 2 * rest.covariance, rel=0.01, abs=1e-5)
    assert np.trace(parts.covariance) > np.trace(whole.covariance)
    # Alternating 1 px in and out: 20 squares beside 6 of 0.09, by 23; what is beyond counts 4.
    points = circle(20)
    away = points - TRUE[:2]
    points += away / TRUE[2] * np.where(np.arange(20) % 2, 1.0, -1.0)[:, None]
    limb = found(points)
    jac, _ = jacobian(points)
    posterior = (6 * 0.09 + 20) / 23
    expected = (0.09 + 4 * (posterior - 0.09)) * (1 + 40 / 289) * np.linalg.inv(jac.T @ jac)
    assert limb.rms_px == pytest.approx(1.0, abs=0.01)
    assert limb.covariance == pytest.approx(expected, rel=0.02, abs=1e-4)


def test_limb_residuals_are_those_after_the_last_fit_step() -> None:
    points = circle(28)
    points[0] += 0.2 * (points[0] - TRUE[:2]) / TRUE[2]
    limb = found(points, allowed=Tolerances(on_px=0.1, good_rms_px=1.0, usual_px=0.3))
    assert limb.on.tolist() == [False] + [True] * 27  # one step brings the circle onto these
    assert limb.rms_px < 0.001


@pytest.mark.parametrize(
    ("value", "cast"),
    [(2.9, 2), (-2.9, -2), (32767.5, 32767), (32768.0, -32768), (-32769.0, 32767), (65536.0, 0)],
)
def test_float_to_int16_cast_truncates_and_wraps(value: float, cast: int) -> None:
    assert to_int16(np.float32(value)) == cast


def test_sequential_sum_rounds_after_every_term() -> None:
    terms = np.array([2**24, 1, 1, 1, 1], np.float32)
    # Each 1 alone is lost beside 2^24; summed in pairs they would not be.
    assert sequential_sum(terms) == 2**24


def test_sequential_sum_of_no_values_is_zero() -> None:
    assert sequential_sum(np.zeros((0, 3), np.float32)).tolist() == [0, 0, 0]
