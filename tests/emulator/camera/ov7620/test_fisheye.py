import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.emulator.camera.ov7620 import fisheye
from cubestack.emulator.camera.ov7620.fisheye import LENSES, lens_of
from cubestack.emulator.camera.ov7620.lens_error import (
    FIELD_DEG,
    NOMINAL,
    SUN_OFFSETS_DEG,
    LensError,
    draw_lens,
)
from cubestack.emulator.scene.attitude import angles_from_vector, vector_from_angles
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.emulator.scene.file import SceneError
from cubestack.firmware_model.interface.cubesense import codes


def towards(theta_deg: float, phi_deg: float) -> np.ndarray:
    """The boresight turned by theta towards phi, x first, then y."""
    phi = np.radians(phi_deg)
    axis = np.array([-np.sin(phi), np.cos(phi), 0])
    return Rotation.from_rotvec(np.radians(theta_deg) * axis).apply([0, 0, 1])


def test_fisheye_distortion_matches_the_published_radii() -> None:
    assert fisheye.distort(182.0) == pytest.approx(168, abs=0.5)  # of the test ball
    assert fisheye.undistort(168.0) == pytest.approx(182, abs=0.5)
    assert fisheye.distort(2.9 * 95) == pytest.approx(226, abs=0.7)  # of the rim
    np.testing.assert_array_equal(fisheye.undistort([0.0, 0.05, 0.1]), 0)


def test_firmware_and_emulator_share_lens_scale_and_camera_numbers() -> None:
    assert codes.PIXELS_PER_DEGREE == fisheye.PIXELS_PER_DEGREE
    assert [(c.name, int(c)) for c in codes.Camera] == [(t.name, int(t)) for t in CameraTarget]


@pytest.mark.parametrize("radius", [0.2, 1.0, 50.0, 168.0, 226.0])
def test_undistort_finds_the_root_of_the_cubic(radius: float) -> None:
    roots = np.roots([-2.5572e-6, 7.6076e-5, 0.9953, 0.1036 - radius])
    inside = [r.real for r in roots if abs(r.imag) < 1e-9 and 0 <= r.real < 276]
    assert inside == [pytest.approx(float(fisheye.undistort(radius)), abs=1e-9)]


def test_alpha_beta_angles_are_a_rotation_from_the_boresight() -> None:
    for theta in (0.0, 10.0, 90.0, 95.0, 170.0):
        for phi in (-170.0, -45.0, 0.0, 90.0, 135.0):
            alpha, beta = theta * np.cos(np.radians(phi)), theta * np.sin(np.radians(phi))
            vector = vector_from_angles(alpha, beta)
            np.testing.assert_allclose(vector, towards(theta, phi), atol=1e-12)
            assert angles_from_vector(3 * vector) == pytest.approx((alpha, beta), abs=1e-9)


@pytest.mark.parametrize(
    ("camera", "centre"), [(CameraTarget.SUN, (369, 250)), (CameraTarget.NADIR, (371, 236))]
)
def test_fisheye_lenses_have_the_published_boresights_and_axes(
    camera: CameraTarget, centre: tuple[float, float]
) -> None:
    lens, (cx, cy) = fisheye.LENSES[camera], centre
    np.testing.assert_array_equal(lens.project([0, 0, 2.0]), centre)
    np.testing.assert_array_equal(lens.unproject([centre]), [[0, 0, 1]])
    right, down = lens.project(towards(63.48, 0)), lens.project(towards(10.0, 90))
    np.testing.assert_allclose(right, (cx + fisheye.distort(63.48 * 2.9), cy))
    np.testing.assert_allclose(down, (cx, cy + fisheye.distort(29.0)))


def test_unproject_inverts_project_within_the_field() -> None:
    lens = fisheye.LENSES[CameraTarget.SUN]
    generator = np.random.default_rng(5)
    for theta, phi in generator.uniform([0, -180], [fisheye.FIELD_DEG, 180], (200, 2)):
        pixel = lens.project(towards(theta, phi))
        np.testing.assert_allclose(lens.unproject([pixel])[0], towards(theta, phi), atol=1e-9)
    assert lens.project(towards(94.999, 20)) is not None
    assert lens.project(towards(95.001, 20)) is lens.project([0, 0, -1.0]) is None


@pytest.mark.parametrize("camera", list(CameraTarget))
def test_lens_field_covers_the_lit_pixels(camera: CameraTarget) -> None:
    lens = fisheye.LENSES[camera]
    field = lens.field
    y, x = np.divmod(field.index, 640)
    whole = field.lit == 1
    expected = lens.unproject(np.stack([x, y], axis=1)[whole])
    np.testing.assert_allclose(field.vectors[whole], expected, atol=1e-6)
    radius = np.hypot(x - lens.cx, y - lens.cy)
    assert radius.max() < 227.2
    assert np.all(field.lit[radius < 226] == 1)
    rows, columns = np.mgrid[:480, :640]
    inside = np.flatnonzero(np.hypot(columns - lens.cx, rows - lens.cy) < 226.5)
    assert set(inside) <= set(field.index)
    assert np.all(np.diff(field.index) > 0)
    # The lit pixels together have the area of the rim's circle, where the sensor does not cut it.
    if lens.cy + 226.7 <= 479.5:
        assert field.lit.sum() == pytest.approx(np.pi * 226.61**2, rel=1e-4)


def test_pixel_solid_angle_is_that_between_its_corners() -> None:
    lens = fisheye.LENSES[CameraTarget.NADIR]
    field = lens.field
    for x, y in [(380, 240), (471, 336), (371, 36), (160, 236)]:
        corners = np.array([[x, y], [x + 1, y], [x, y + 1]]) - 0.5
        here, right, down = lens.unproject(corners)
        area = np.linalg.norm(np.cross(right - here, down - here))
        at = np.searchsorted(field.index, y * 640 + x)
        assert field.pixel_rad[at] == pytest.approx(np.sqrt(area), rel=0.02)


def test_rim_pixels_are_lit_by_their_share_of_the_field() -> None:
    lens = fisheye.LENSES[CameraTarget.NADIR]
    rim = float(fisheye.distort(2.9 * 95))
    fine = (np.arange(10) - 4.5) / 10
    rows, columns = np.divmod(lens.field.index, 640)
    x = (columns - lens.cx)[:, None, None] + fine[:, None]
    y = (rows - lens.cy)[:, None, None] + fine
    inside = np.mean(np.hypot(x, y) < rim, axis=(1, 2))
    assert np.abs(lens.field.lit - inside).max() < 0.2  # a straight edge across, not askew
    assert lens.field.lit.sum(dtype=float) == pytest.approx(inside.sum(), rel=1e-3)
    assert 200 < np.sum((lens.field.lit > 0) & (lens.field.lit < 1)) < 2000


LENS = LensError((0.4, -0.3), ((40.0, 0.3), (75.0, 1.85)), (0.1, -0.05))
SERIALS = range(40)


def polar(theta: float, phi: float) -> np.ndarray:
    return theta * np.array([np.cos(phi), np.sin(phi)])


def test_radial_lens_error_matches_its_nodes_and_vanishes_on_axis_and_rim() -> None:
    lens = LensError(radial_deg=LENS.radial_deg)
    for theta, error in [(0, 0), *LENS.radial_deg, (FIELD_DEG, 0)]:
        for phi in (0.0, 1.0, 4.0):
            moved = lens.displace(polar(theta, phi))
            np.testing.assert_allclose(moved, polar(theta + error, phi), atol=1e-12)
    between = [lens.displace(polar(theta, 0))[0] - theta for theta in range(41, 75)]
    assert np.all(np.diff(between) > 0)
    even = LensError(radial_deg=((30.0, 0.5), (60.0, 0.5)))
    for theta in (33.0, 45.0, 57.0):
        np.testing.assert_allclose(even.displace(polar(theta, 0)), (theta + 0.5, 0), atol=1e-12)


def test_decentring_follows_brown_near_the_axis_and_vanishes_at_the_rim() -> None:
    p1, p2 = 0.3, -0.2
    x, y = 0.02, 0.05
    moved = LensError(decentring_deg=(p1, p2)).displace(np.array([x, y]) * FIELD_DEG)
    square = x * x + y * y
    expected = [p2 * (square + 2 * x * x) + 2 * p1 * x * y]
    expected += [p1 * (square + 2 * y * y) + 2 * p2 * x * y]
    np.testing.assert_allclose(moved - np.array([x, y]) * FIELD_DEG, expected, rtol=0.01)
    rim = polar(FIELD_DEG, 2.0)
    np.testing.assert_allclose(LENS.displace(rim), rim, atol=1e-12)


def test_unproject_inverts_project_with_a_lens_error() -> None:
    lens, nominal = lens_of(CameraTarget.SUN, LENS), LENSES[CameraTarget.SUN]
    generator = np.random.default_rng(3)
    for theta, phi in generator.uniform([0.5, -3], [FIELD_DEG, 3], (100, 2)):
        direction = vector_from_angles(*polar(theta, phi))
        pixel = lens.project(direction)
        np.testing.assert_allclose(lens.unproject([pixel])[0], direction, atol=1e-9)
        seen = angles_from_vector(nominal.unproject([pixel - LENS.centre_px])[0])
        np.testing.assert_allclose(seen, LENS.displace(polar(theta, phi)), atol=1e-6)
    assert lens.project(vector_from_angles(95.01, 0)) is None


def test_lens_error_keeps_the_published_rim() -> None:
    lens, nominal = (
        lens_of(CameraTarget.NADIR, LensError(LENS.centre_px)),
        LENSES[CameraTarget.NADIR],
    )
    field = lens_of(CameraTarget.NADIR, LENS).field
    np.testing.assert_array_equal(field.index, lens.field.index)
    assert field.lit.sum() == pytest.approx(nominal.field.lit.sum(), rel=1e-3)
    assert not np.allclose(field.vectors, lens.field.vectors, atol=1e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"radial_deg": ((40.0, 0.1), (40.0, 0.2))},
        {"radial_deg": ((95.0, 0.1),)},
        {"radial_deg": ((40.0, 0.0), (42.0, 3.0))},
        {"decentring_deg": (30.0, 0.0)},
    ],
)
def test_rejects_impossible_lens(wrong: dict[str, tuple[float, ...]]) -> None:
    with pytest.raises(SceneError, match=f"{next(iter(wrong))}.* must"):
        LensError(**wrong)


def test_each_unit_has_its_own_lens_errors() -> None:
    drawn = [draw_lens(camera, serial) for camera in CameraTarget for serial in SERIALS]
    assert len(set(drawn)) == len(drawn)
    assert draw_lens(CameraTarget.NADIR, 7) == draw_lens(CameraTarget.NADIR, 7) != NOMINAL
    centres = np.array([lens.centre_px for lens in drawn])
    assert np.abs(centres).max() <= 0.5
    assert np.abs(centres.mean(axis=0)).max() < 0.1


def test_sun_lens_errors_are_outward_within_the_published_maximum() -> None:
    for serial in SERIALS:
        radial = draw_lens(CameraTarget.SUN, serial).radial_deg
        for (angle, error), (expected, most) in zip(radial, SUN_OFFSETS_DEG, strict=True):
            assert angle == expected
            assert 0.6 * most <= error <= most
