"""Centroids that the host reads, against the truth (CubeStar thesis, section 4.1.6)."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS
from cubestack.emulator.scene.attitude import matrix_from_quaternion, quaternion_from_pointing
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.emulator.scene.sky import SkyScene

STARS = 18
PUBLISHED_MEAN_ERROR_PX = (0.0244, 0.0427)
SIGMA_PX = 1.0

#: Eighteen stars brighter than V 3.8 are seen here, all of them in the onboard catalogue.
POINTING_DEG = (100.0, 10.0, 0.0)


def drawn_stars(centres: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Stars as the thesis draws them: 5 x 5 pixels of a Gaussian with a peak of 255."""
    picture = np.zeros((512, 1024), np.uint8)
    for x, y in centres:
        rows, columns = np.mgrid[round(y) - 2 : round(y) + 3, round(x) - 2 : round(x) + 3]
        squared = (columns - x) ** 2 + (rows - y) ** 2
        picture[rows, columns] = np.round(255 * np.exp(-squared / (2 * SIGMA_PX**2)))
    return picture


def measured(session: Any) -> NDArray[np.float64]:
    return np.array([(star.x_px, star.y_px) for star in session.client.stars()])


def test_centroid_errors_of_uploaded_stars_are_small(
    session: Any, rng: np.random.Generator
) -> None:
    cells = rng.permutation(10 * 5)[:STARS]  # one star a cell keeps them apart
    centres = np.stack([cells % 10 * 100 + 50, cells // 10 * 100 + 50], axis=1)
    centres = centres + rng.uniform(-20, 20, centres.shape)
    with session(SkyScene.pointing(0, 0)) as opened:
        opened.client.upload_image(drawn_stars(centres))
        opened.client.process_image()
        found = measured(opened)
    assert len(found) == STARS
    nearest = np.linalg.norm(found[:, None] - centres, axis=2).argmin(axis=1)
    assert sorted(nearest) == list(range(STARS))
    mean_error = np.abs(found - centres[nearest]).mean(axis=0)
    assert np.all(mean_error <= PUBLISHED_MEAN_ERROR_PX)


def test_centroid_errors_without_noise_are_small(session: Any) -> None:
    scene = SkyScene(quaternion_from_pointing(*POINTING_DEG), mag_limit=3.8)
    with session(SkyView(scene, replace(CONDITION, noise=False))) as opened:
        opened.client.capture_and_process()
        stars = opened.client.stars()
        matrix = matrix_from_quaternion(opened.board.truth())
    assert len(stars) == STARS
    sky = load_sky()
    rows = np.searchsorted(sky.hip, [star.hipparcos for star in stars])
    true = LENS.project(sky.vectors[rows] @ matrix.T)
    errors = np.array([(star.x_px, star.y_px) for star in stars]) - true
    assert np.all(np.abs(errors).mean(axis=0) <= PUBLISHED_MEAN_ERROR_PX)
