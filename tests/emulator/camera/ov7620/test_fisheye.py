import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.emulator.camera.ov7620 import fisheye
from cubestack.emulator.scene.attitude import angles_from_vector, vector_from_angles
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.firmware_model.interface.cubesense import codes


def towards(theta_deg: float, phi_deg: float) -> np.ndarray:
    """The boresight turned by theta towards phi, x first, then y."""
    phi = np.radians(phi_deg)
    axis = np.array([-np.sin(phi), np.cos(phi), 0])
    return Rotation.from_rotvec(np.radians(theta_deg) * axis).apply([0, 0, 1])


def test_published_radii() -> None:
    assert fisheye.distort(182.0) == pytest.approx(168, abs=0.5)  # of the test ball
    assert fisheye.undistort(168.0) == pytest.approx(182, abs=0.5)
    assert fisheye.distort(2.9 * 95) == pytest.approx(226, abs=0.7)  # of the rim
    np.testing.assert_array_equal(fisheye.undistort([0.0, 0.05, 0.1]), 0)


def test_the_firmware_knows_the_lens_and_the_picture() -> None:
    assert codes.PIXELS_PER_DEGREE == fisheye.PIXELS_PER_DEGREE
    assert [(c.name, int(c)) for c in codes.Camera] == [(t.name, int(t)) for t in CameraTarget]


@pytest.mark.parametrize("radius", [0.2, 1.0, 50.0, 168.0, 226.0])
def test_undistorting_finds_the_root_of_the_cubic(radius: float) -> None:
    roots = np.roots([-2.5572e-6, 7.6076e-5, 0.9953, 0.1036 - radius])
    inside = [r.real for r in roots if abs(r.imag) < 1e-9 and 0 <= r.real < 276]
    assert inside == [pytest.approx(float(fisheye.undistort(radius)), abs=1e-9)]


def test_angles_are_a_turn_away_from_the_boresight() -> None:
    for theta in (0.0, 10.0, 90.0, 95.0, 170.0):
        for phi in (-170.0, -45.0, 0.0, 90.0, 135.0):
            alpha, beta = theta * np.cos(np.radians(phi)), theta * np.sin(np.radians(phi))
            vector = vector_from_angles(alpha, beta)
            np.testing.assert_allclose(vector, towards(theta, phi), atol=1e-12)
            assert angles_from_vector(3 * vector) == pytest.approx((alpha, beta), abs=1e-9)


@pytest.mark.parametrize(
    ("camera", "centre"), [(CameraTarget.SUN, (369, 250)), (CameraTarget.NADIR, (371, 236))]
)
def test_published_boresights_and_axes(camera: CameraTarget, centre: tuple[float, float]) -> None:
    lens, (cx, cy) = fisheye.LENSES[camera], centre
    np.testing.assert_array_equal(lens.project([0, 0, 2.0]), centre)
    np.testing.assert_array_equal(lens.unproject([centre]), [[0, 0, 1]])
    right, down = lens.project(towards(63.48, 0)), lens.project(towards(10.0, 90))
    np.testing.assert_allclose(right, (cx + fisheye.distort(63.48 * 2.9), cy))
    np.testing.assert_allclose(down, (cx, cy + fisheye.distort(29.0)))


def test_projecting_is_undone_within_the_field() -> None:
    lens = fisheye.LENSES[CameraTarget.SUN]
    generator = np.random.default_rng(5)
    for theta, phi in generator.uniform([0, -180], [fisheye.FIELD_DEG, 180], (200, 2)):
        pixel = lens.project(towards(theta, phi))
        np.testing.assert_allclose(lens.unproject([pixel])[0], towards(theta, phi), atol=1e-9)
    assert lens.project(towards(94.999, 20)) is not None
    assert lens.project(towards(95.001, 20)) is lens.project([0, 0, -1.0]) is None


@pytest.mark.parametrize("camera", list(CameraTarget))
def test_field_of_view(camera: CameraTarget) -> None:
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


def test_pixel_angle_is_that_between_neighbours() -> None:
    lens = fisheye.LENSES[CameraTarget.NADIR]
    field = lens.field
    for x, y in [(380, 240), (471, 336), (371, 36), (160, 236)]:
        here, right, down = lens.unproject(
            [[x - 0.5, y - 0.5], [x + 0.5, y - 0.5], [x - 0.5, y + 0.5]]
        )
        area = np.linalg.norm(np.cross(right - here, down - here))
        at = np.searchsorted(field.index, y * 640 + x)
        assert field.pixel_rad[at] == pytest.approx(np.sqrt(area), rel=0.02)


def test_pixels_on_the_rim_are_lit_by_their_share_of_it() -> None:
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
