"""The tables, and the quick check of coefficients against the makers of the tables."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.optimize import brentq

from cubestack.firmware_model.cubesense.vision import distortion
from cubestack.firmware_model.cubesense.vision.distortion import (
    TABLE_ENTRIES,
    DistortionError,
    Projection,
    RadiusTable,
    byte_table,
    fine_table,
)
from cubestack.firmware_model.cubesense.vision.lens_check import invertible
from cubestack.firmware_model.interface.cubesense.codes import coefficient
from cubestack.firmware_model.interface.cubesense.telecommands import DISTORTION
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20

from ..scenery import PX_PER_DEG, distort


def exact(radius: float) -> float:
    """Undistorted radius, by a bracketing solver."""
    if radius <= distort(0.0):
        return 0.0
    return float(brentq(lambda wide: float(distort(wide)) - radius, 0, 340))


def test_byte_distortion_table_matches_the_published_one(meter: Meter) -> None:
    table = byte_table(meter)
    assert table.size == TABLE_ENTRIES == 227
    assert table.differences[-1] == 49
    assert 168 + table.differences[168] == 182
    assert table.differences.min() == 0
    wanted = [max(0, np.ceil(exact(radius) - radius)) for radius in range(TABLE_ENTRIES)]
    assert table.differences.tolist() == wanted


def test_published_distortion_drops_the_fraction_of_the_radius(meter: Meter) -> None:
    table = byte_table(meter)
    # Table entries 13 and 14 px: 167 + 13 + 0.5.
    assert table.differences[167:169].tolist() == [14, 14]
    assert table.correct(np.array([[167.5, 0]], np.float32), meter).tolist() == [[18100, 0]]
    first, second = table.differences[200:202]
    expected = int(100 * (200 + first + 0.25 * (second - first)))
    assert table.correct(np.array([[0, -200.25]], np.float32), meter).tolist() == [[0, -expected]]


@pytest.mark.parametrize("turn", range(0, 360, 40))
def test_distortion_table_is_exact_to_a_fiftieth_of_a_pixel(
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


def test_distortion_leaves_the_boresight_unchanged(meter: Meter, equidistant: RadiusTable) -> None:
    assert equidistant.correct(np.zeros((1, 2), np.float32), meter).tolist() == [[0, 0]]


def test_radius_table_is_extrapolated_with_its_last_step(
    meter: Meter, equidistant: RadiusTable
) -> None:
    points = np.array([[225, 0], [226, 0], [227, 0], [228.5, 0]], np.float32)
    x = equidistant.correct(points, meter)[:, 0].astype(int)
    assert x[2] - x[1] == pytest.approx(x[1] - x[0], abs=1)
    assert x[3] - x[1] == pytest.approx(2.5 * (x[1] - x[0]), abs=4)


def test_distortion_results_wrap_at_16_bits(meter: Meter) -> None:
    far = RadiusTable(np.full(TABLE_ENTRIES, 150, np.int16), 1, 1, False)
    x = far.correct(np.array([[200, 0]], np.float32), meter)[0, 0]
    assert x == 35000 - 65536


def test_distortion_table_follows_other_coefficients(meter: Meter) -> None:
    table = fine_table(meter, Projection.EQUIDISTANT, (0.0, 0.5))
    assert table.differences.tolist() == [100 * radius for radius in range(TABLE_ENTRIES)]


@pytest.mark.parametrize("coefficients", [(0.0, -1.0), (0.0, 1.0, -0.01), (0.0, 0.0), (0.0, 0.1)])
def test_rejects_distortion_without_inverse(meter: Meter, coefficients: tuple[float, ...]) -> None:
    with pytest.raises(DistortionError, match="must"):
        fine_table(meter, Projection.EQUIDISTANT, coefficients)


def test_distortion_cost_is_equal_per_point_and_higher_for_wide_tables(
    meter: Meter, equidistant: RadiusTable
) -> None:
    table = byte_table(meter)
    costs = []
    for used, count in ((table, 1), (table, 10), (equidistant, 1)):
        meter.take()
        used.correct(np.ones((count, 2), np.float32), meter)
        costs.append(meter.take())
    assert costs[1] == 10 * costs[0]
    assert costs[2] > costs[0]


def tables_exist(factors: Sequence[float]) -> bool:
    meter = Meter(PIC18F45K20)
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            distortion.byte_table(meter, factors)
            for projection in distortion.Projection:
                distortion.fine_table(meter, projection, factors)
    except distortion.DistortionError:
        return False
    return True


def random_factors(rng: np.random.Generator) -> list[float]:
    match rng.integers(0, 3):
        case 0:  # what a telecommand can carry
            carried = rng.integers((-32768, 0), (32768, 256), (5, 2)).tolist()
            return [coefficient(*pair) for pair in carried]
        case 1:
            return [rng.normal() * size for size in (10, 1, 3e-3, 1e-5, 4e-8)]
        case _:  # lenses like ours
            changed = [value * (1 + 0.5 * rng.normal()) for value in DISTORTION[:4]]
            return [*changed, 1e-8 * rng.normal()]


@pytest.mark.slow
def test_lens_check_accepts_only_lenses_with_inverse_tables() -> None:
    rng = np.random.default_rng(54)
    verdicts: Counter[tuple[bool, bool]] = Counter()
    for _ in range(3000):
        factors = random_factors(rng)
        verdicts[invertible(factors, Meter(PIC18F45K20)), tables_exist(factors)] += 1
    assert verdicts[True, False] == 0
    assert verdicts[True, True] > 2 * verdicts[False, True] > 0
    assert verdicts[False, False] > 500


@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        (DISTORTION, True),
        ((0, 1, 0, 0, 0), True),
        ((0, 0.75, 0, 0, 0), True),
        ((0, 4, 0, 0, 0), True),
        ((0, 0.71, 0, 0, 0), True),
        ((0, 0.7, 0, 0, 0), False),  # the rim at 323 px: results might wrap
        ((0, 0, 0, 0, 0), False),
        ((0, -1, 0, 0, 0), False),
        ((0, 0.5, 0, 0, 0), False),  # too far away
        ((100, 1, 0, 0, 0), False),
        ((0, 1, 0, -1e-5, 0), False),  # falls before the rim
        ((0, 32767, 32767, 32767, 32767), False),
        ((0, 1e-255, 0, 0, 0), False),
        ((-32768, -32768, -32768, -32768, -32768), False),
    ],
)
def test_lens_check_accepts_and_rejects_known_lenses(
    factors: Sequence[float], expected: bool
) -> None:
    assert invertible(factors, Meter(PIC18F45K20)) is expected
    assert tables_exist(factors) or not expected


def test_lens_check_finds_a_negative_slope_between_its_samples() -> None:
    """The slope is 0.002 (r - 20)^2 - 0.05, so it is negative around 20 px only."""
    factors = (0, 0.75, -0.04, 0.002 / 3, 0)
    assert invertible(factors, Meter(PIC18F45K20)) is tables_exist(factors) is False


@pytest.mark.parametrize(("ratio", "expected"), [(2.99, True), (3.01, False)])
def test_slopes_are_compared_from_centre_to_rim(ratio: float, expected: bool) -> None:
    """A parabola's slope squared rises with the distorted radius: 4 b for a pixel."""
    offset, slope = 8, 0.5
    bend = slope**2 * (ratio**2 - 1) / 4 / (226 - offset + ratio**2 * offset)
    middle, rim = (np.sqrt(slope**2 + 4 * bend * (radius - offset)) for radius in (0, 226))
    assert rim / middle == pytest.approx(ratio)
    assert invertible((offset, slope, bend, 0, 0), Meter(PIC18F45K20)) is expected


def test_lens_check_takes_under_a_tenth_of_the_table_time() -> None:
    meter, table = Meter(PIC18F45K20), Meter(PIC18F45K20)
    assert invertible(DISTORTION, meter)
    distortion.fine_table(table, distortion.Projection.STEREOGRAPHIC)
    assert meter.table.seconds(meter.total) < 0.07 < table.table.seconds(table.total) / 10
