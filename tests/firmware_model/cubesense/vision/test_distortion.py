import numpy as np
import pytest
from scipy.optimize import brentq

from cubestack.firmware_model.cubesense.vision.distortion import (
    TABLE_ENTRIES,
    DistortionError,
    Projection,
    RadiusTable,
    byte_table,
    fine_table,
)
from cubestack.firmware_model.mcu.costs import Meter

from ..scenery import PX_PER_DEG, distort


def exact(radius: float) -> float:
    """Undistorted radius, by a bracketing solver."""
    if radius <= distort(0.0):
        return 0.0
    return float(brentq(lambda wide: float(distort(wide)) - radius, 0, 340))


def test_the_published_table(meter: Meter) -> None:
    table = byte_table(meter)
    assert table.size == TABLE_ENTRIES == 227
    assert table.differences[-1] == 49
    assert 168 + table.differences[168] == 182
    assert table.differences.min() == 0
    wanted = [max(0, np.ceil(exact(radius) - radius)) for radius in range(TABLE_ENTRIES)]
    assert table.differences.tolist() == wanted


def test_the_published_interpolation_drops_the_radius_s_fraction(meter: Meter) -> None:
    table = byte_table(meter)
    # Table entries 13 and 14 px: 167 + 13 + 0.5.
    assert table.differences[167:169].tolist() == [14, 14]
    assert table.correct(np.array([[167.5, 0]], np.float32), meter).tolist() == [[18100, 0]]
    first, second = table.differences[200:202]
    expected = int(100 * (200 + first + 0.25 * (second - first)))
    assert table.correct(np.array([[0, -200.25]], np.float32), meter).tolist() == [[0, -expected]]


@pytest.mark.parametrize("turn", range(0, 360, 40))
def test_ours_is_right_to_a_fiftieth_of_a_pixel(
    meter: Meter, equidistant: RadiusTable, stereographic: RadiusTable, turn: int
) -> None:
    radii = np.linspace(1, 226, 150)
    along = np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn))])
    points = (radii[:, None] * along).astype(np.float32)
    wide = np.array([exact(radius) for radius in radii])
    measured = equidistant.correct(points, meter) / 100
    assert np.abs(measured - wide[:, None] * along).max() < 0.025
    # Any circle of the sky is to be a circle, at half of the equidistant scale in the middle.
    focal = np.degrees(PX_PER_DEG)
    tangent = focal * np.tan(wide / focal / 2)
    measured = stereographic.correct(points, meter) / 100
    assert np.abs(measured - tangent[:, None] * along).max() < 0.025


def test_the_boresight_stays(meter: Meter, equidistant: RadiusTable) -> None:
    assert equidistant.correct(np.zeros((1, 2), np.float32), meter).tolist() == [[0, 0]]


def test_beyond_the_table_its_last_step_goes_on(meter: Meter, equidistant: RadiusTable) -> None:
    points = np.array([[225, 0], [226, 0], [227, 0], [228.5, 0]], np.float32)
    x = equidistant.correct(points, meter)[:, 0].astype(int)
    assert x[2] - x[1] == pytest.approx(x[1] - x[0], abs=1)
    assert x[3] - x[1] == pytest.approx(2.5 * (x[1] - x[0]), abs=4)


def test_results_wrap_as_an_int_does(meter: Meter) -> None:
    far = RadiusTable(np.full(TABLE_ENTRIES, 150, np.int16), 1, 1, False)
    x = far.correct(np.array([[200, 0]], np.float32), meter)[0, 0]
    assert x == 35000 - 65536


def test_other_coefficients(meter: Meter) -> None:
    table = fine_table(meter, Projection.EQUIDISTANT, (0.0, 0.5))
    assert table.differences.tolist() == [100 * radius for radius in range(TABLE_ENTRIES)]


@pytest.mark.parametrize("coefficients", [(0.0, -1.0), (0.0, 1.0, -0.01), (0.0, 0.0), (0.0, 0.1)])
def test_rejects_distortion_without_inverse(meter: Meter, coefficients: tuple[float, ...]) -> None:
    with pytest.raises(DistortionError, match="must"):
        fine_table(meter, Projection.EQUIDISTANT, coefficients)


def test_points_cost_the_same_and_a_wide_table_more(meter: Meter, equidistant: RadiusTable) -> None:
    table = byte_table(meter)
    costs = []
    for used, count in ((table, 1), (table, 10), (equidistant, 1)):
        meter.take()
        used.correct(np.ones((count, 2), np.float32), meter)
        costs.append(meter.take())
    assert costs[1] == 10 * costs[0]
    assert costs[2] > costs[0]
