"""Fits against cameras that are known; attitudes are scipy's."""

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
    """Random skies through the camera, places with noise."""
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


def test_a_camera_is_recovered_exactly_from_exact_stars() -> None:
    fit = fit_camera(sights(4), GUESS)
    assert asdict(fit.camera) == pytest.approx(asdict(TRUE), rel=1e-6, abs=1e-8)
    assert fit.after_px < 1e-6 < 0.5 < fit.before_px
    assert (fit.pictures, len(fit.places), fit.rejected) == (4, 60, 0)


def test_errors_are_as_large_as_the_fit_says() -> None:
    fits = [fit_camera(sights(6, 0.05, seed=seed), GUESS) for seed in range(12)]
    assert np.mean([fit.after_px for fit in fits]) == pytest.approx(0.05 * np.sqrt(2), rel=0.15)
    for name in PARAMETERS:
        off = [(getattr(fit.camera, name) - getattr(TRUE, name)) / fit.sigma[name] for fit in fits]
        assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.7


def test_wrong_stars_are_left_out() -> None:
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


def test_what_was_left_out_leaves_no_trace_in_the_camera() -> None:
    given = sights(4)
    given[0].pixels[7] += 3  # near enough to be taken at first
    fit = fit_camera(given, GUESS)
    assert fit.rejected == 1
    assert asdict(fit.camera) == pytest.approx(asdict(TRUE), rel=1e-6, abs=1e-8)


def test_pairs_near_the_middle_give_the_focal_length() -> None:
    fit = fit_camera(sights(10, stars=30), TRUE)
    assert fit.pairs_f_px == pytest.approx(TRUE.f_px, rel=0.01)


def test_parameters_that_are_not_free_stay() -> None:
    fit = fit_camera(sights(4), GUESS, ("f_px", "cx_px"))
    assert fit.sigma.keys() == {"f_px", "cx_px"}
    assert (fit.camera.cy_px, fit.camera.k1) == (GUESS.cy_px, GUESS.k1)


@pytest.mark.parametrize("given", [sights(2), sights(5, stars=4), []])
def test_too_few_stars_are_told(given: list[Sight]) -> None:
    with pytest.raises(ValueError, match=r"needs 3 pictures .*; of \d pictures \d have them"):
        fit_camera(given, GUESS)


def test_a_camera_file_is_read_as_it_was_written(tmp_path) -> None:
    save_camera(TRUE, tmp_path / "camera.json")
    assert load_camera(tmp_path / "camera.json") == TRUE
    with pytest.raises(CameraFileError, match="a file is to be written here"):
        save_camera(TRUE, tmp_path)
