import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.firmware_model.attitude.field_of_view import FieldOfView, field_of_view
from cubestack.firmware_model.attitude.float_functions import arc_cosine, arc_tangent, cosine, sine
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
from tests.together import together

#: Figure 5.12 with the signs of the coefficients inverted, focal length from star pairs (5.4).
C = CameraParameters(6.28, 1147.5, 1147.4, 539.0, 175.5, 0.32358, -0.12456, -0.00414, 0.00624)
NAMES = ("focal_length_mm", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")


def brown(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Equations 4.1.3 to 4.1.5 for one point, written out in double precision."""
    x, y = (p[0] - 539.0) / 1147.5, (p[1] - 175.5) / 1147.4
    r2 = x * x + y * y
    gain = 1 + 0.32358 * r2 - 0.12456 * r2 * r2
    u = x * gain + 0.00624 * (r2 + 2 * x * x) + 2 * -0.00414 * x * y
    v = y * gain + -0.00414 * (r2 + 2 * y * y) + 2 * 0.00624 * x * y
    return np.array([539.0 + 1147.5 * u, 175.5 + 1147.4 * v])


def test_undistortion_follows_the_published_equations_everywhere() -> None:
    points = np.random.default_rng(1).uniform([0, 0], [1023, 511], (300, 2)).astype(np.float32)
    expected = [brown(p) for p in points.astype(np.float64)]
    np.testing.assert_allclose(undistort(points, C, Meter(CORTEX_M3)), expected, atol=5e-4)


@pytest.mark.parametrize("seed", range(4))
def test_undistort_inverts_an_exact_camera(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ray = np.array([rng.uniform(-0.4, 0.38), rng.uniform(-0.14, 0.28), 1.0])
    pinhole = np.array([539.0, 175.5]) + 6.28 / 0.0056 * ray[:2]
    pixel = least_squares(lambda p: brown(p) - pinhole, pinhole, xtol=1e-15, ftol=1e-15).x
    meter = Meter(CORTEX_M3)
    found = unit_vectors(undistort(pixel[None].astype(np.float32), C, meter), C, meter)[0]
    assert found.dtype == np.float32
    assert math.dist(found, ray / np.linalg.norm(ray)) < 1e-6


def test_undistortion_cost_is_proportional_to_the_points() -> None:
    costs = []
    for count in (0, 1, 11):
        meter = Meter(CORTEX_M3)
        unit_vectors(undistort(np.ones((count, 2), np.float32), C, meter), C, meter)
        costs.append(meter.total)
    assert costs[2] - costs[0] == 11 * (costs[1] - costs[0]) > 0


@together("seed", range(20))
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
    with pytest.raises(CameraParameterError, match=f"{name} must be above 0, not 0.0"):
        CameraParameters(**(dict.fromkeys(NAMES, 1.0) | {name: 0.0}))


RNG = np.random.default_rng(5)
F = np.float32


def units(found: NDArray[np.float32], wanted: NDArray[np.float64]) -> float:
    """Largest error in units of the last place."""
    assert found.dtype == np.float32
    return float(np.max(np.abs(found - wanted) / np.spacing(np.abs(wanted).astype(F))))


def test_arc_cosine_is_accurate_to_2_ulp() -> None:
    x = np.concatenate([RNG.uniform(-1, 1, 100_000), 1 - np.logspace(-7, -1, 1000)]).astype(F)
    assert units(arc_cosine(x), np.arccos(x.astype(float))) < 2


def test_arc_tangent_is_accurate_to_the_last_places() -> None:
    y, x = RNG.normal(size=(2, 100_000)).astype(F)
    assert units(arc_tangent(y, x), np.arctan2(y.astype(float), x.astype(float))) < 3


@pytest.mark.parametrize(("function", "exact"), [(sine, np.sin), (cosine, np.cos)])
def test_sine_and_cosine_errors_are_below_2_to_the_minus_23(
    function: Callable[[Any], NDArray[np.float32]], exact: Callable[[Any], Any]
) -> None:
    x = RNG.uniform(-np.pi, 2 * np.pi, 100_000).astype(F)
    assert np.max(np.abs(function(x) - exact(x.astype(float)))) < 2**-23


def test_arc_functions_are_exact_at_special_points() -> None:
    assert arc_cosine(np.array([1, 0.5, 0, -0.5, -1], F)).tolist() == pytest.approx(
        [0, math.pi / 3, math.pi / 2, 2 * math.pi / 3, math.pi], rel=1e-7
    )
    y, x = np.array([(0, 0), (1, 0), (0, -1), (-1, 0), (0, 1), (1, 1)], F).T
    corners = arc_tangent(y, x)
    assert corners.tolist() == pytest.approx(
        [0, math.pi / 2, math.pi, -math.pi / 2, 0, math.pi / 4], rel=1e-7
    )
    assert sine(np.zeros(1, F)) == 0
    assert cosine(np.zeros(1, F)) == 1


COLUMNS, ROWS = 1024, 512
NEAR_PX = 2.0


def calibrated(lens: Optics) -> FieldOfView:
    return field_of_view(CameraParameters(**{n: getattr(lens, n) for n in NAMES}), COLUMNS, ROWS)


def rays_ahead(seed: int, count: int) -> NDArray[np.float64]:
    """Unit vectors (count, 3) in the field and around it."""
    sides = np.random.default_rng(seed).uniform([-0.7, -0.5], [0.7, 0.5], (count, 2))
    rays = np.column_stack([sides, np.ones(count)])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


@pytest.mark.parametrize("factor", [1.0, 0.98])
def test_field_of_view_matches_the_lens(factor: float) -> None:
    rays = rays_ahead(1, 4000)
    pixels = LENS.project(rays)
    pixels[np.isnan(pixels)] = -999.0
    depth = np.minimum(pixels, np.array([COLUMNS - 1, ROWS - 1]) - pixels).min(axis=1)
    clear = np.abs(depth) > NEAR_PX
    longer = rays * [factor, factor, 1.0]
    longer /= np.linalg.norm(longer, axis=1, keepdims=True)
    inside = calibrated(LENS).contains(longer.astype(np.float32), Meter(CORTEX_M3), factor)
    assert (inside == (depth > 0))[clear].all()
    assert 500 < np.count_nonzero(inside) < 3500


def test_field_of_view_ends_at_the_outer_pixel_edges() -> None:
    focal_px, middle = 1000.0, np.array([COLUMNS / 2, ROWS / 2]) - 0.5
    camera = CameraParameters(6.0, focal_px, focal_px, *middle, 0, 0, 0, 0, pitch_mm=0.006)
    field = field_of_view(camera, COLUMNS, ROWS)
    for corner in ([-0.5, -0.5], [COLUMNS - 0.5, ROWS - 0.5]):
        inwards = np.sign(middle - corner)
        for axis in ([1, 0], [0, 1]):
            pixels = corner + 9 * inwards + np.outer([-8.8, -9.2], inwards) * axis
            rays = np.column_stack([(pixels - middle) / focal_px, np.ones(2)]).astype(np.float32)
            assert field.contains(rays, Meter(CORTEX_M3)).tolist() == [True, False]


def test_field_solid_angle_matches_sampling() -> None:
    rng = np.random.default_rng(2)
    rays = rng.normal(size=(400_000, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    field = calibrated(LENS)
    ahead = rays[rays[:, 2] >= field.smallest_cosine].astype(np.float32)
    part = np.count_nonzero(field.contains(ahead, Meter(CORTEX_M3))) / len(rays)
    assert field.solid_angle_sr == pytest.approx(4 * np.pi * part, rel=0.02)
    assert ahead[field.contains(ahead, Meter(CORTEX_M3)), 2].min() < field.smallest_cosine + 0.01


def test_blind_cells_are_excluded_from_the_field_of_view() -> None:
    field = calibrated(LENS)
    cell = 64
    blind = np.zeros((ROWS // cell, COLUMNS // cell), np.bool_)
    blind[2:5, 3:9] = blind[7, 15] = True
    seen = field.without(blind)
    share = 1 - np.count_nonzero(blind) / blind.size
    assert seen.solid_angle_sr == pytest.approx(share * field.solid_angle_sr)
    assert field.without(np.zeros_like(blind)) is field

    rays = rays_ahead(3, 8000)
    rays = rays[field.contains(rays.astype(np.float32), Meter(CORTEX_M3))]
    across, down = np.nan_to_num(LENS.project(rays), nan=-999.0).T
    inside = (across >= 0) & (across < COLUMNS) & (down >= 0) & (down < ROWS)
    rays, across, down = rays[inside], across[inside], down[inside]
    expected = ~blind[(down / cell).astype(int), (across / cell).astype(int)]
    # The cells follow the field's sides, and the distortion between them by half a cell.
    wrong = expected != seen.contains(rays.astype(np.float32), Meter(CORTEX_M3))
    assert np.count_nonzero(wrong) <= 0.05 * len(rays)
    assert np.count_nonzero(~expected) > 0.1 * len(rays)
