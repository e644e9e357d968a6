"""Oracle: the emulated lens of the calibration toolbox."""

from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.camera.common.optics import Distortion
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.host.calibration.camera import Camera

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
