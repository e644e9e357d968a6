import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from cubestack.firmware_model.attitude.geometry import (
    CameraParameterError,
    CameraParameters,
    angles_of,
    direction_of,
    undistort,
    unit_vectors,
)
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter

#: Figure 5.12 with the signs of the coefficients inverted, focal length from star pairs (5.4).
C = CameraParameters(
    focal_length_mm=6.28,
    fx=1147.5,
    fy=1147.4,
    cx=539.0,
    cy=175.5,
    k1=0.32358,
    k2=-0.12456,
    p1=-0.00414,
    p2=0.00624,
)


def brown(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Equations 4.1.3 to 4.1.5 for one point, written out in double precision."""
    x, y = (p[0] - 539.0) / 1147.5, (p[1] - 175.5) / 1147.4
    r2 = x * x + y * y
    gain = 1 + 0.32358 * r2 - 0.12456 * r2 * r2
    u = x * gain + 0.00624 * (r2 + 2 * x * x) + 2 * -0.00414 * x * y
    v = y * gain + -0.00414 * (r2 + 2 * y * y) + 2 * 0.00624 * x * y
    return np.array([539.0 + 1147.5 * u, 175.5 + 1147.4 * v])


def test_every_part_of_the_picture_is_undistorted_as_the_equations_say() -> None:
    points = np.random.default_rng(1).uniform([0, 0], [1023, 511], (300, 2)).astype(np.float32)
    expected = [brown(p) for p in points.astype(np.float64)]
    np.testing.assert_allclose(undistort(points, C, Meter(CORTEX_M3)), expected, atol=5e-4)


@pytest.mark.parametrize("seed", range(4))
def test_directions_come_back_from_a_camera_that_inverts_the_equations(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ray = np.array([rng.uniform(-0.4, 0.38), rng.uniform(-0.14, 0.28), 1.0])
    pinhole = np.array([539.0, 175.5]) + 6.28 / 0.0056 * ray[:2]
    pixel = least_squares(lambda p: brown(p) - pinhole, pinhole, xtol=1e-15, ftol=1e-15).x
    meter = Meter(CORTEX_M3)
    found = unit_vectors(undistort(pixel[None].astype(np.float32), C, meter), C, meter)[0]
    assert found.dtype == np.float32
    assert math.dist(found, ray / np.linalg.norm(ray)) < 1e-6


def test_the_charge_grows_with_the_number_of_points() -> None:
    costs = []
    for count in (0, 1, 11):
        meter = Meter(CORTEX_M3)
        unit_vectors(undistort(np.ones((count, 2), np.float32), C, meter), C, meter)
        costs.append(meter.total)
    assert costs[2] - costs[0] == 11 * (costs[1] - costs[0]) > 0


@pytest.mark.parametrize("seed", range(20))
def test_sky_angles_and_directions_are_inverse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ra, dec = rng.uniform(-3.14, 3.14), rng.uniform(-1.57, 1.57)
    vector = direction_of(ra, dec, Meter(CORTEX_M3))
    expected = [math.cos(dec) * math.cos(ra), math.cos(dec) * math.sin(ra), math.sin(dec)]
    np.testing.assert_allclose(vector, expected, atol=3e-7)
    found = angles_of(vector, Meter(CORTEX_M3))
    assert found[1] == pytest.approx(dec, abs=1e-6)
    assert found[0] * math.cos(dec) == pytest.approx(ra * math.cos(dec), abs=1e-6)


@pytest.mark.parametrize("name", ["focal_length_mm", "fx", "fy", "pitch_mm"])
def test_lengths_must_be_positive(name: str) -> None:
    values = dict.fromkeys(("focal_length_mm", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"), 1.0)
    with pytest.raises(CameraParameterError, match=f"{name} must be above 0, not 0.0"):
        CameraParameters(**(values | {name: 0.0}))
