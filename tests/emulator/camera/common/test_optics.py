from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyval2d
from scipy.optimize import fsolve

from cubestack.emulator.camera.common.optics import Distortion
from cubestack.emulator.camera.common.residual import Residual, displace, restore
from cubestack.emulator.camera.mlx75412.imager import DN12_PER_DN8, ELECTRONS_PER_DN12
from cubestack.emulator.camera.mlx75412.lens import EFFECTIVE_WIDTH_A, LENS
from cubestack.firmware_model.interface.cubestar import INTERFACE


def grid(step: int = 16) -> np.ndarray:
    y, x = np.mgrid[0:512:step, 0:1024:step]
    corners = [[-0.5, -0.5], [1023.5, -0.5], [-0.5, 511.5], [1023.5, 511.5]]
    return np.concatenate([np.stack([x.ravel(), y.ravel()], axis=1), corners])


def firmware_vectors(pixels: np.ndarray) -> np.ndarray:
    """Equations 4.1.3 to 4.1.6 with the thesis' calibration, written down a second time."""
    k1, k2, p1, p2 = 0.32358, -0.12456, -0.00414, 0.00624
    x, y = (pixels[:, 0] - 539.0) / 1147.5, (pixels[:, 1] - 175.5) / 1147.4
    r2 = x**2 + y**2
    xu = x * (1 + k1 * r2 + k2 * r2**2) + p2 * (r2 + 2 * x**2) + 2 * p1 * x * y
    yu = y * (1 + k1 * r2 + k2 * r2**2) + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    u = np.stack([1147.5 * xu * 0.0056 / 6.28, 1147.4 * yu * 0.0056 / 6.28, np.ones(len(x))], 1)
    return u / np.linalg.norm(u, axis=1, keepdims=True)


def test_default_lens_satisfies_the_firmware_equations_exactly() -> None:
    np.testing.assert_allclose(LENS.unproject(grid()), firmware_vectors(grid()), atol=1e-15)


@pytest.mark.parametrize("distortion", Distortion)
def test_unproject_and_project_are_inverse(distortion: Distortion) -> None:
    lens = replace(LENS, distortion=distortion)
    np.testing.assert_allclose(lens.project(lens.unproject(grid())), grid(), atol=1e-9)


def test_lens_projection_equals_a_numerical_inverse() -> None:
    generator = np.random.default_rng(5)
    for pixel in generator.uniform([0, 0], [1023, 511], (20, 2)):
        vector = firmware_vectors(pixel[None])[0]

        def miss(guess: np.ndarray, vector: np.ndarray = vector) -> np.ndarray:
            found = firmware_vectors(guess[None])[0]
            return (found[:2] / found[2] - vector[:2] / vector[2]) * 1000

        solved = fsolve(miss, pixel + 3, xtol=1e-13)
        np.testing.assert_allclose(LENS.project(vector[None])[0], solved, atol=1e-8)


def test_undistorted_lens_is_a_pinhole_with_the_published_field() -> None:
    lens = replace(LENS, k1=0, k2=0, p1=0, p2=0)
    angle = np.radians(10)
    pixels = lens.project(np.array([[np.sin(angle), 0, np.cos(angle)], [0, 0, 1]]))
    np.testing.assert_allclose(pixels, [[539 + 6.28 / 0.0056 * np.tan(angle), 175.5], [539, 175.5]])
    # 49.1 x 25.7 deg at 6.28 mm, for a centred principal point.
    edges = np.array([[-0.5, 255.5], [1023.5, 255.5], [511.5, -0.5], [511.5, 511.5]])
    left, right, top, bottom = replace(lens, cx=511.5, cy=255.5).unproject(edges)
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(49.1, abs=0.1)
    assert np.degrees(np.arccos(top @ bottom)) == pytest.approx(25.7, abs=0.1)


def test_toolbox_distortion_equals_the_toolbox_formula() -> None:
    # Camera Calibration Toolbox: x_d = (1 + kc1 r2 + kc2 r4) x + dx with kc as published.
    kc = (-0.32358, 0.12456, 0.00414, -0.00624)
    lens = replace(LENS, distortion=Distortion.TOOLBOX)
    generator = np.random.default_rng(6)
    plane = generator.uniform([-0.4, -0.15], [0.4, 0.25], (50, 2))
    vectors = np.concatenate([plane, np.ones((50, 1))], axis=1)
    x, y = (plane * (6.28 / 0.0056) / [1147.5, 1147.4]).T
    r2 = x**2 + y**2
    radial = 1 + kc[0] * r2 + kc[1] * r2**2
    xd = radial * x + 2 * kc[2] * x * y + kc[3] * (r2 + 2 * x**2)
    yd = radial * y + kc[2] * (r2 + 2 * y**2) + 2 * kc[3] * x * y
    expected = np.stack([1147.5 * xd + 539.0, 1147.4 * yd + 175.5], axis=1)
    np.testing.assert_allclose(lens.project(vectors), expected, atol=1e-9)


def test_error_of_the_toolbox_reading_is_as_documented() -> None:
    lens = replace(LENS, distortion=Distortion.TOOLBOX)
    true, computed = lens.unproject(grid(4)), firmware_vectors(grid(4))
    miss = (true[:, :2] / true[:, 2:] - computed[:, :2] / computed[:, 2:]) * 1147.5
    miss_px = np.linalg.norm(miss, axis=1)
    assert miss_px.mean() == pytest.approx(1.7, abs=0.1)
    assert miss_px.max() == pytest.approx(15, abs=0.5)


def test_directions_outside_the_lens_are_nan() -> None:
    assert LENS.half_field_deg == pytest.approx(31.4, abs=0.1)
    angles = np.radians([0, 31, 36, 60, 89, 90, 91, 180])
    x, y = -np.cos(0.56), np.sin(0.56)  # towards the farthest corner
    vectors = np.stack([np.sin(angles) * x, np.sin(angles) * y, np.cos(angles)], axis=1)
    assert list(np.isnan(LENS.project(vectors)).any(axis=1)) == [False, False] + [True] * 6
    assert LENS.project(np.empty((0, 3))).shape == (0, 2)


def test_direction_outside_the_field_does_not_hide_others() -> None:
    lens = replace(LENS, k1=-0.62, k2=0, p1=0, p2=0)  # folds right outside of the sensor
    plane = np.linspace(0, 0.55, 200)
    vectors = np.stack([plane, 0 * plane, np.ones(200)], axis=1)
    seen = ~np.isnan(lens.project(vectors)).any(axis=1)
    reach = int(seen.sum())
    assert 150 < reach < 200
    assert seen[:reach].all()
    np.testing.assert_array_equal(lens.project(vectors)[:reach], lens.project(vectors[:reach]))


@pytest.mark.parametrize("stop_deg", [10.0, 40.0, 179.0, 180.0, 360.0])
def test_field_stop_transmits_a_circular_field(stop_deg: float) -> None:
    """Of 180 deg and more there is none."""
    angles = np.radians([0.0, stop_deg / 2 - 0.01, stop_deg / 2 + 0.01, 89.6])
    vectors = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=1)
    light = replace(LENS, field_stop_deg=stop_deg).transmission(vectors)
    beyond = float(stop_deg >= 180)
    assert light.tolist() == [1, 1, beyond, beyond]


@pytest.mark.parametrize(("cx", "cy"), [(450, 200), (450, 300), (600, 200), (600, 300)])
def test_half_field_is_the_angle_to_the_farthest_corner(cx: float, cy: float) -> None:
    """Corners of the outermost pixels, not their centres."""
    lens = replace(LENS, cx=cx, cy=cy)
    corner = (1023.5 if cx < 511.5 else -0.5, 511.5 if cy < 255.5 else -0.5)
    (vector,) = lens.unproject(np.array([corner]))
    assert lens.half_field_deg == pytest.approx(np.degrees(np.arccos(vector[2])), abs=1e-9)


def test_lens_vignetting_follows_the_cosine_power() -> None:
    vectors = np.array([[0, 0, 1.0], [np.sin(0.5), 0, np.cos(0.5)]])
    np.testing.assert_array_equal(LENS.transmission(vectors), [1, 1])
    natural = replace(LENS, vignetting=4)
    np.testing.assert_allclose(natural.transmission(vectors), [1, np.cos(0.5) ** 4])


@pytest.mark.parametrize("changes", [{"k1": -1.5}, {"k1": 1.5, "distortion": Distortion.TOOLBOX}])
def test_rejects_impossible_lenses(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="folds the picture within the sensor"):
        replace(LENS, **changes)


@pytest.mark.parametrize(("cx", "cy"), [(24, 20), (24, 28), (40, 20), (40, 28)])
def test_distortion_may_fold_back_just_outside_the_image(cx: float, cy: float) -> None:
    """r + k1 r^3 turns back where 3 k1 r^2 = -1; the farthest corner may be as near as that."""
    across, down = max(cx + 0.5, 63.5 - cx), max(cy + 0.5, 47.5 - cy)
    turn = -(LENS.fx**2) / (3 * (across**2 + down**2))
    small = replace(LENS, columns=64, rows=48, cx=cx, cy=cy, fy=LENS.fx, k1=0, k2=0, p1=0, p2=0)
    replace(small, k1=0.99 * turn)
    with pytest.raises(ValueError, match="folds the picture within the sensor"):
        replace(small, k1=1.01 * turn)


def test_default_firmware_calibration_matches_the_lens() -> None:
    commands = "FocalLength FocalLengthComponents PrincipalPoint RadialDistortionGains"
    reset = {
        field.name: field.reset
        for command in f"{commands} TangentalDistortionGains".split()
        for field in INTERFACE.telecommand(f"set{command}").fields
    }
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
    lens = {name.capitalize(): getattr(LENS, name) for name in names}
    assert reset == lens | {"FocalLength": LENS.focal_length_mm}


def test_star_at_the_detection_limit_has_the_expected_counts() -> None:
    electrons = LENS.electrons_per_second(3.8) * 0.3856
    assert electrons / ELECTRONS_PER_DN12 / DN12_PER_DN8 == pytest.approx(300, abs=1)
    assert 0.6 * 3000 < EFFECTIVE_WIDTH_A < 0.8 * 6000  # within the published factors


def test_star_flux_follows_equation_3_4_2() -> None:
    # Aperture in cm^2, times width, times 10^((15 - 2M)/5) photons: a hundred in five magnitudes.
    magnitudes = np.linspace(-1.4, 6, 12)
    expected = np.pi * 0.25**2 * EFFECTIVE_WIDTH_A * 10 ** ((15 - 2 * magnitudes) / 5)
    np.testing.assert_allclose(LENS.electrons_per_second(magnitudes), expected)
    wider = replace(LENS, aperture_mm=10.0, effective_width_a=2 * EFFECTIVE_WIDTH_A)
    np.testing.assert_allclose(wider.electrons_per_second(magnitudes), 8 * expected)


SHAPE = (512, 1024)
GENERATOR = np.random.default_rng(11)
ACROSS = tuple(tuple(row) for row in (GENERATOR.uniform(-1, 1, (4, 3)) * 0.5).tolist())
DOWN = ((0.2, 0.0, -0.3, 0.0, 0.0), (0.0,), (), (0.1, 0.4))
"""With rows of other lengths, and zeros at their ends."""

RESIDUAL = Residual(SHAPE, ACROSS, DOWN)
PIXELS = GENERATOR.uniform((0, 0), (1023, 511), (400, 2))


def test_residual_is_a_polynomial_over_the_sensor() -> None:
    x, y = PIXELS[:, 0] / 511.5 - 1, PIXELS[:, 1] / 255.5 - 1
    down = np.array([row + (0.0,) * (5 - len(row)) for row in DOWN])
    expected = [polyval2d(x, y, np.array(ACROSS)), polyval2d(x, y, down)]
    np.testing.assert_allclose(RESIDUAL.at(PIXELS).T, expected, atol=1e-12)


def test_residual_grid_spans_the_corners_and_is_constant_beyond() -> None:
    tilt = Residual(SHAPE, ((0.0,), (1.0,)), ((0.0, 1.0),))
    corners = np.array([[0.0, 0.0], [1023.0, 0.0], [1023.0, 511.0], [511.5, 255.5]])
    expected = [[-1, -1], [1, -1], [1, 1], [0, 0]]
    np.testing.assert_allclose(tilt.at(corners), expected, atol=1e-12)
    beyond = np.array([[-50.0, -1.0], [2000.0, -7.0], [1024.0, 600.0]])
    np.testing.assert_allclose(tilt.at(beyond), expected[:3], atol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_displace_and_restore_are_inverse(count: int) -> None:
    residuals = (RESIDUAL, Residual(SHAPE, DOWN, ACROSS))[:count]
    seen = displace(PIXELS, residuals)
    np.testing.assert_allclose(restore(seen, residuals), PIXELS, atol=1e-10)
    np.testing.assert_allclose(displace(restore(PIXELS, residuals), residuals), PIXELS, atol=1e-9)
    assert bool(np.all(seen == PIXELS)) is (count == 0)


def test_displacement_uses_the_residual_at_the_displaced_pixel() -> None:
    seen = displace(PIXELS, (RESIDUAL,))
    np.testing.assert_allclose(seen - RESIDUAL.at(seen), PIXELS, atol=1e-10)


def test_nan_points_stay_nan() -> None:
    some = PIXELS.copy()
    some[3] = np.nan
    seen = displace(some, (RESIDUAL,))
    assert np.isnan(seen[3]).all()
    others = np.delete(displace(PIXELS, (RESIDUAL,)), 3, 0)
    np.testing.assert_array_equal(np.delete(seen, 3, 0), others)
