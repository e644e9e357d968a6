"""The camera of a file, beside the emulated lens of the calibration toolbox."""

from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.camera.common.optics import Distortion
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.host.calibration.camera import Camera

POINTS = np.stack(np.meshgrid(np.linspace(-0.4, 0.4, 7), np.linspace(-0.2, 0.2, 5)), -1)
NONE = {"k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0}


@pytest.mark.parametrize(
    "terms",
    [
        {},
        {"k1": -0.2},
        {"k2": 0.1},
        {"p1": 0.004},
        {"p2": -0.003},
        {"k1": -0.2, "k2": 0.1, "p1": 0.004, "p2": -0.003},
    ],
)
def test_each_term_of_the_distortion_is_the_toolbox_s(terms: dict[str, float]) -> None:
    camera = Camera(1050.0, 500.0, 260.0, **NONE | terms)
    inverted = {name: -value for name, value in (NONE | terms).items()}
    lens = replace(
        LENS,
        **inverted,
        fx=1050.0,
        fy=1050.0,
        cx=500.0,
        cy=260.0,
        distortion=Distortion.TOOLBOX,
        focal_length_mm=1050.0 * LENS.pixel_pitch_um / 1000,
        residuals=(),
    )
    vectors = np.concatenate([POINTS, np.ones((*POINTS.shape[:-1], 1))], axis=-1).reshape(-1, 3)
    seen = lens.project(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
    np.testing.assert_allclose(camera.directions(3 * vectors), seen, atol=1e-6)
    np.testing.assert_allclose(camera.project(POINTS).reshape(-1, 2), seen, atol=1e-6)
    np.testing.assert_allclose(camera.unproject(camera.project(POINTS)), POINTS, atol=1e-6)


def test_a_part_of_a_picture_has_the_same_camera() -> None:
    camera = Camera(1050.0, 500.0, 260.0, -0.2, 0.1, 0.004, -0.003)
    part = camera.cropped(100.0, 30.0)
    np.testing.assert_allclose(part.project(POINTS), camera.project(POINTS) - (100.0, 30.0))


def test_a_distortion_that_can_not_be_inverted_is_told() -> None:
    camera = Camera(1000.0, 0.0, 0.0, k1=-3.0)
    with pytest.raises(ValueError, match=r"cannot be inverted over the frame: k1 -3, k2 0"):
        camera.unproject(np.array([[900.0, 0.0]]))
