"""The quick check of distortion coefficients against the makers of the tables."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.vision import distortion
from cubestack.firmware_model.cubesense.vision.lens_check import invertible
from cubestack.firmware_model.interface.cubesense.codes import coefficient
from cubestack.firmware_model.interface.cubesense.telecommands import DISTORTION
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20


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
            return [
                coefficient(int(rng.integers(-32768, 32768)), int(rng.integers(0, 256)))
                for _ in range(5)
            ]
        case 1:
            return [rng.normal() * size for size in (10, 1, 3e-3, 1e-5, 4e-8)]
        case _:  # lenses like ours
            changed = [value * (1 + 0.5 * rng.normal()) for value in DISTORTION[:4]]
            return [*changed, 1e-8 * rng.normal()]


def test_what_is_accepted_gives_tables_and_lenses_like_ours_are() -> None:
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
def test_known_lenses(factors: Sequence[float], expected: bool) -> None:
    assert invertible(factors, Meter(PIC18F45K20)) is expected
    assert tables_exist(factors) or not expected


def test_a_dip_between_the_tried_radii_is_found() -> None:
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


def test_it_is_quick() -> None:
    meter, table = Meter(PIC18F45K20), Meter(PIC18F45K20)
    assert invertible(DISTORTION, meter)
    distortion.fine_table(table, distortion.Projection.STEREOGRAPHIC)
    assert meter.table.seconds(meter.total) < 0.07 < table.table.seconds(table.total) / 10
