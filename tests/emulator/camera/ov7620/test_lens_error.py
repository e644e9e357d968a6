import numpy as np
import pytest

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

LENS = LensError((0.4, -0.3), ((40.0, 0.3), (75.0, 1.85)), (0.1, -0.05))
SERIALS = range(40)


def polar(theta: float, phi: float) -> np.ndarray:
    return theta * np.array([np.cos(phi), np.sin(phi)])


def test_a_radial_error_is_that_of_its_nodes_and_none_on_axis_and_rim() -> None:
    lens = LensError(radial_deg=LENS.radial_deg)
    for theta, error in [(0, 0), *LENS.radial_deg, (FIELD_DEG, 0)]:
        for phi in (0.0, 1.0, 4.0):
            moved = lens.displace(polar(theta, phi))
            np.testing.assert_allclose(moved, polar(theta + error, phi), atol=1e-12)
    between = [lens.displace(polar(theta, 0))[0] - theta for theta in range(41, 75)]
    assert np.all(np.diff(between) > 0)


def test_between_nodes_of_one_error_there_is_no_other() -> None:
    lens = LensError(radial_deg=((30.0, 0.5), (60.0, 0.5)))
    for theta in (33.0, 45.0, 57.0):
        np.testing.assert_allclose(lens.displace(polar(theta, 0)), (theta + 0.5, 0), atol=1e-12)


def test_decentring_is_brown_s_near_the_axis_and_none_at_the_rim() -> None:
    p1, p2 = 0.3, -0.2
    x, y = 0.02, 0.05
    moved = LensError(decentring_deg=(p1, p2)).displace(np.array([x, y]) * FIELD_DEG)
    square = x * x + y * y
    expected = [p2 * (square + 2 * x * x) + 2 * p1 * x * y]
    expected += [p1 * (square + 2 * y * y) + 2 * p2 * x * y]
    np.testing.assert_allclose(moved - np.array([x, y]) * FIELD_DEG, expected, rtol=0.01)
    rim = polar(FIELD_DEG, 2.0)
    np.testing.assert_allclose(LENS.displace(rim), rim, atol=1e-12)


def test_projecting_is_undone_and_shifted_by_the_error() -> None:
    lens, nominal = lens_of(CameraTarget.SUN, LENS), LENSES[CameraTarget.SUN]
    generator = np.random.default_rng(3)
    for theta, phi in generator.uniform([0.5, -3], [FIELD_DEG, 3], (100, 2)):
        direction = vector_from_angles(*polar(theta, phi))
        pixel = lens.project(direction)
        np.testing.assert_allclose(lens.unproject([pixel])[0], direction, atol=1e-9)
        seen = angles_from_vector(nominal.unproject([pixel - LENS.centre_px])[0])
        np.testing.assert_allclose(seen, LENS.displace(polar(theta, phi)), atol=1e-6)
    assert lens.project(vector_from_angles(95.01, 0)) is None


def test_the_rim_stays_where_it_is_published() -> None:
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


def test_units_have_lenses_of_their_own() -> None:
    drawn = [draw_lens(camera, serial) for camera in CameraTarget for serial in SERIALS]
    assert len(set(drawn)) == len(drawn)
    assert draw_lens(CameraTarget.NADIR, 7) == draw_lens(CameraTarget.NADIR, 7) != NOMINAL
    centres = np.array([lens.centre_px for lens in drawn])
    assert np.abs(centres).max() <= 0.5
    assert np.abs(centres.mean(axis=0)).max() < 0.1


def test_the_sun_s_lenses_err_outwards_by_up_to_what_is_published() -> None:
    for serial in SERIALS:
        radial = draw_lens(CameraTarget.SUN, serial).radial_deg
        for (angle, error), (expected, most) in zip(radial, SUN_OFFSETS_DEG, strict=True):
            assert angle == expected
            assert 0.6 * most <= error <= most
