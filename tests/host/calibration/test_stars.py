"""Oracles: cameras with known parameters; attitudes by scipy."""

from dataclasses import asdict

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.host.calibration.camera import Camera, load_camera, save_camera
from cubestack.host.calibration.stars import PARAMETERS, Sight, fit_camera
from cubestack.host.errors import CameraFileError

TRUE = Camera(1100.0, 530.0, 200.0, -0.3, 0.15, 0.003, -0.002)
GUESS = Camera(1110.0, 520.0, 210.0, -0.27, 0.12)
SIZE = (1023, 511)


def sights(count: int, noise_px: float = 0.0, stars: int = 15, seed: int = 1) -> list[Sight]:
    rng, found = np.random.default_rng(seed), []
    for turn in Rotation.random(count, random_state=seed):
        plane = np.stack([rng.uniform(-0.5, 0.5, 400), rng.uniform(-0.25, 0.35, 400)], axis=1)
        pixels = TRUE.project(plane)
        inside = np.flatnonzero(((pixels > 0) & (pixels < SIZE)).all(axis=1))[:stars]
        body = np.concatenate([plane, np.ones((400, 1))], axis=1)[inside]
        body /= np.linalg.norm(body, axis=1, keepdims=True)
        measured = pixels[inside] + rng.normal(0, noise_px, (len(inside), 2))
        found.append(Sight(measured, turn.inv().apply(body)))
    return found


def test_exact_stars_give_the_exact_camera() -> None:
    fit = fit_camera(sights(4), GUESS)
    assert asdict(fit.camera) == pytest.approx(asdict(TRUE), rel=1e-6, abs=1e-8)
    assert fit.after_px < 1e-6 < 0.5 < fit.before_px
    assert (fit.pictures, len(fit.places), fit.rejected) == (4, 60, 0)


def test_sigma_matches_the_scatter_of_fits() -> None:
    fits = [fit_camera(sights(6, 0.05, seed=seed), GUESS) for seed in range(12)]
    assert np.mean([fit.after_px for fit in fits]) == pytest.approx(0.05 * np.sqrt(2), rel=0.15)
    for name in PARAMETERS:
        off = [(getattr(fit.camera, name) - getattr(TRUE, name)) / fit.sigma[name] for fit in fits]
        assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.7


def test_rejects_wrong_stars() -> None:
    given = sights(6, 0.02)
    for sight in given:
        sight.pixels[3] += 60
        sight.vectors[5] = -sight.vectors[5]
    given[0].pixels[7] += 3  # near enough to be taken at first
    given[1] = Sight(given[1].pixels, given[2].vectors)  # another sky's names
    fit = fit_camera(given, GUESS)
    assert fit.rejected == 5 * 2 + 15 + 1
    assert fit.pictures == 5
    assert fit.camera.f_px == pytest.approx(TRUE.f_px, abs=0.3)


def test_rejected_star_does_not_change_the_camera() -> None:
    given = sights(4)
    given[0].pixels[7] += 3  # near enough to be taken at first
    fit = fit_camera(given, GUESS)
    assert fit.rejected == 1
    assert asdict(fit.camera) == pytest.approx(asdict(TRUE), rel=1e-6, abs=1e-8)


def test_pairs_near_the_middle_give_the_focal_length() -> None:
    fit = fit_camera(sights(10, stars=30), TRUE)
    assert fit.pairs_f_px == pytest.approx(TRUE.f_px, rel=0.01)


def test_fixed_parameters_do_not_change() -> None:
    fit = fit_camera(sights(4), GUESS, ("f_px", "cx_px"))
    assert fit.sigma.keys() == {"f_px", "cx_px"}
    assert (fit.camera.cy_px, fit.camera.k1) == (GUESS.cy_px, GUESS.k1)


@pytest.mark.parametrize("given", [sights(2), sights(5, stars=4), []])
def test_rejects_too_few_stars(given: list[Sight]) -> None:
    with pytest.raises(ValueError, match=r"needs 3 pictures .*; of \d pictures \d have them"):
        fit_camera(given, GUESS)


def test_camera_file_round_trip(tmp_path) -> None:
    save_camera(TRUE, tmp_path / "camera.json")
    assert load_camera(tmp_path / "camera.json") == TRUE
    with pytest.raises(CameraFileError, match="choose a path that can be written"):
        save_camera(TRUE, tmp_path)
