"""Oracle: the emulated lens of the calibration toolbox."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.emulator.camera.common.optics import Distortion
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.host.calibration.camera import Camera, load_camera, save_camera
from cubestack.host.calibration.fisheye import Fisheye, fit_fisheye, limb_angles
from cubestack.host.calibration.stars import PARAMETERS, Sight, fit_camera

POINTS = np.stack(np.meshgrid(np.linspace(-0.4, 0.4, 7), np.linspace(-0.2, 0.2, 5)), -1)
TERMS = {"k1": -0.2, "k2": 0.1, "p1": 0.004, "p2": -0.003}
NONE = dict.fromkeys(TERMS, 0.0)


@pytest.mark.parametrize("terms", [*({name: value} for name, value in TERMS.items()), {}, TERMS])
def test_distortion_terms_match_the_toolbox(terms: dict[str, float]) -> None:
    camera = Camera(1050.0, 500.0, 260.0, **NONE | terms)
    inverted = {name: -value for name, value in (NONE | terms).items()}
    places = {"fx": 1050.0, "fy": 1050.0, "cx": 500.0, "cy": 260.0}
    focal_length_mm = 1050.0 * LENS.pixel_pitch_um / 1000
    lens = replace(
        LENS,
        **inverted | places,
        distortion=Distortion.TOOLBOX,
        focal_length_mm=focal_length_mm,
        residuals=(),
    )
    vectors = np.concatenate([POINTS, np.ones((*POINTS.shape[:-1], 1))], axis=-1).reshape(-1, 3)
    seen = lens.project(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
    np.testing.assert_allclose(camera.directions(3 * vectors), seen, atol=1e-6)
    np.testing.assert_allclose(camera.project(POINTS).reshape(-1, 2), seen, atol=1e-6)
    np.testing.assert_allclose(camera.unproject(camera.project(POINTS)), POINTS, atol=1e-6)


def test_crop_moves_the_principal_point() -> None:
    camera = Camera(1050.0, 500.0, 260.0, -0.2, 0.1, 0.004, -0.003)
    part = camera.cropped(100.0, 30.0)
    np.testing.assert_allclose(part.project(POINTS), camera.project(POINTS) - (100.0, 30.0))


def test_rejects_a_distortion_that_cannot_be_inverted() -> None:
    camera = Camera(1000.0, 0.0, 0.0, k1=-3.0)
    with pytest.raises(ValueError, match=r"cannot be inverted over the frame: k1 -3, k2 0"):
        camera.unproject(np.array([[900.0, 0.0]]))


TABLES = Fisheye(371.0, 236.0, (0.1036, 0.9953, 7.6076e-5, -2.5572e-6, 0.0), 2.9, 95.0)
RIM = 95 * 2.9
#: Another polynomial with the published rim.
CUBE = (np.polyval(TABLES.factors[::-1], RIM) - 1.003 * RIM - 3e-5 * RIM**2) / RIM**3
TRUE = Fisheye(371.4, 235.7, (0.0, 1.003, 3e-5, CUBE, 0.0), 2.9, 95.0)
ANGLES = np.array([[a, b] for a in range(-35, 66, 20) for b in range(-55, 36, 20)], float)


def test_fits_axis_and_polynomial_from_lights() -> None:
    fit = fit_fisheye(TRUE.project(ANGLES), lambda _: ANGLES, TABLES, outline=False)
    assert (fit.lens.x_px, fit.lens.y_px) == pytest.approx((TRUE.x_px, TRUE.y_px), abs=0.01)
    np.testing.assert_allclose(fit.lens.project(ANGLES), TRUE.project(ANGLES), atol=0.05)
    assert fit.after_px < 0.03 < 0.4 < fit.before_px
    rim = np.array([[95.0, 0.0]])
    np.testing.assert_allclose(
        fit.lens.project(rim), np.add(TABLES.project(rim), (0.4, -0.3)), atol=0.1
    )


def limb(radius_deg: float, centre_deg: tuple[float, float]) -> np.ndarray:
    """Angles (n, 2) all around a circle in the sky."""
    around = np.radians(np.arange(0, 360, 20))
    cone = np.radians(radius_deg)
    ring = np.sin(cone) * np.stack([np.cos(around), np.sin(around)])
    circle = np.vstack([ring, np.full(len(around), np.cos(cone))]).T
    a, b = np.radians(centre_deg)
    x, y, z = Rotation.from_rotvec([-b, a, 0]).apply(circle).T
    return np.degrees(np.arctan2(np.hypot(x, y), z) / np.hypot(x, y))[:, None] * np.stack([x, y], 1)


def test_fits_axis_and_polynomial_from_limbs() -> None:
    centres = [(0.0, 0.0), (25.0, 0.0), (-10.0, 20.0), (0.0, -28.0), (-22.0, -5.0)]
    angles = [limb(63.48, centre) for centre in centres]
    at = np.concatenate(
        [np.full((len(points), 2), c) for points, c in zip(angles, centres, strict=True)]
    )
    pixels = TRUE.project(np.concatenate(angles))
    azimuths = np.arctan2(*np.concatenate(angles).T[::-1])
    np.testing.assert_allclose(limb_angles(azimuths, at, 63.48), np.concatenate(angles), atol=1e-9)
    fit = fit_fisheye(pixels, lambda phi: limb_angles(phi, at, 63.48), TABLES, outline=True)
    assert (fit.lens.x_px, fit.lens.y_px) == pytest.approx((TRUE.x_px, TRUE.y_px), abs=0.03)
    assert fit.after_px < 0.03 < 0.3 < fit.before_px


def test_rejects_fewer_than_8_lights() -> None:
    with pytest.raises(ValueError, match="needs 8 places at least; 7 were found"):
        fit_fisheye(TRUE.project(ANGLES[:7]), lambda _: ANGLES[:7], TABLES, outline=False)


TRUE_CAMERA = Camera(1100.0, 530.0, 200.0, -0.3, 0.15, 0.003, -0.002)
GUESS = Camera(1110.0, 520.0, 210.0, -0.27, 0.12)
SIZE = (1023, 511)


def sights(count: int, noise_px: float = 0.0, stars: int = 15, seed: int = 1) -> list[Sight]:
    rng, found = np.random.default_rng(seed), []
    for turn in Rotation.random(count, random_state=seed):
        plane = np.stack([rng.uniform(-0.5, 0.5, 400), rng.uniform(-0.25, 0.35, 400)], axis=1)
        pixels = TRUE_CAMERA.project(plane)
        inside = np.flatnonzero(((pixels > 0) & (pixels < SIZE)).all(axis=1))[:stars]
        body = np.concatenate([plane, np.ones((400, 1))], axis=1)[inside]
        body /= np.linalg.norm(body, axis=1, keepdims=True)
        measured = pixels[inside] + rng.normal(0, noise_px, (len(inside), 2))
        found.append(Sight(measured, turn.inv().apply(body)))
    return found


def test_calibration_from_exact_stars_finds_the_exact_camera() -> None:
    fit = fit_camera(sights(4), GUESS)
    assert asdict(fit.camera) == pytest.approx(asdict(TRUE_CAMERA), rel=1e-6, abs=1e-8)
    assert fit.after_px < 1e-6 < 0.5 < fit.before_px
    assert (fit.pictures, len(fit.places), fit.rejected) == (4, 60, 0)


@pytest.mark.slow
def test_sigma_matches_the_scatter_of_fits() -> None:
    fits = [fit_camera(sights(6, 0.05, seed=seed), GUESS) for seed in range(12)]
    assert np.mean([fit.after_px for fit in fits]) == pytest.approx(0.05 * np.sqrt(2), rel=0.15)
    for name in PARAMETERS:
        off = [
            (getattr(fit.camera, name) - getattr(TRUE_CAMERA, name)) / fit.sigma[name]
            for fit in fits
        ]
        assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.7


def test_calibration_rejects_misidentified_stars() -> None:
    given = sights(6, 0.02)
    for sight in given:
        sight.pixels[3] += 60
        sight.vectors[5] = -sight.vectors[5]
    given[0].pixels[7] += 3  # near enough to be taken at first
    given[1] = Sight(given[1].pixels, given[2].vectors)  # another sky's names
    fit = fit_camera(given, GUESS)
    assert fit.rejected == 5 * 2 + 15 + 1
    assert fit.pictures == 5
    assert fit.camera.f_px == pytest.approx(TRUE_CAMERA.f_px, abs=0.3)


def test_rejected_star_does_not_change_the_camera() -> None:
    given = sights(4)
    given[0].pixels[7] += 3  # near enough to be taken at first
    fit = fit_camera(given, GUESS)
    assert fit.rejected == 1
    assert asdict(fit.camera) == pytest.approx(asdict(TRUE_CAMERA), rel=1e-6, abs=1e-8)


def test_calibration_estimates_focal_length_from_central_star_pairs() -> None:
    fit = fit_camera(sights(10, stars=30), TRUE_CAMERA)
    assert fit.pairs_f_px == pytest.approx(TRUE_CAMERA.f_px, rel=0.01)


def test_fixed_parameters_do_not_change() -> None:
    fit = fit_camera(sights(4), GUESS, ("f_px", "cx_px"))
    assert fit.sigma.keys() == {"f_px", "cx_px"}
    assert (fit.camera.cy_px, fit.camera.k1) == (GUESS.cy_px, GUESS.k1)


@pytest.mark.parametrize("given", [sights(2), sights(5, stars=4), []])
def test_rejects_too_few_stars(given: list[Sight]) -> None:
    with pytest.raises(ValueError, match=r"needs 3 pictures .*; of \d pictures \d have them"):
        fit_camera(given, GUESS)


def test_camera_file_round_trip(tmp_path) -> None:
    save_camera(TRUE_CAMERA, tmp_path / "camera.json")
    assert load_camera(tmp_path / "camera.json") == TRUE_CAMERA
    with pytest.raises(ValueError, match=r"can not write .*: Is a directory"):
        save_camera(TRUE_CAMERA, tmp_path)
