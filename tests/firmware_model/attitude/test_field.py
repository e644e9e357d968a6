"""The border of the picture, beside the lens itself."""

import numpy as np
import pytest

from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.firmware_model.attitude.field import Field, field_of
from cubestack.firmware_model.attitude.geometry import CameraParameters
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter

COLUMNS, ROWS = 1024, 512
NEAR_PX = 2.0


def calibrated(lens: Optics) -> Field:
    names = ("focal_length_mm", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
    return field_of(CameraParameters(**{n: getattr(lens, n) for n in names}), COLUMNS, ROWS)


@pytest.mark.parametrize("factor", [1.0, 0.98])
def test_it_is_that_of_the_lens(factor: float) -> None:
    rng = np.random.default_rng(1)
    rays = np.column_stack([rng.uniform([-0.7, -0.5], [0.7, 0.5], (4000, 2)), np.ones(4000)])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    pixels = LENS.project(rays)
    pixels[np.isnan(pixels)] = -999.0
    depth = np.minimum(pixels, np.array([COLUMNS - 1, ROWS - 1]) - pixels).min(axis=1)
    clear = np.abs(depth) > NEAR_PX
    longer = rays * [factor, factor, 1.0]
    longer /= np.linalg.norm(longer, axis=1, keepdims=True)
    inside = calibrated(LENS).contains(longer.astype(np.float32), Meter(CORTEX_M3), factor)
    assert (inside == (depth > 0))[clear].all()
    assert 500 < np.count_nonzero(inside) < 3500


def test_its_solid_angle_is_the_part_of_the_sphere() -> None:
    rng = np.random.default_rng(2)
    rays = rng.normal(size=(400_000, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    field = calibrated(LENS)
    ahead = rays[rays[:, 2] >= field.smallest_cosine].astype(np.float32)
    part = np.count_nonzero(field.contains(ahead, Meter(CORTEX_M3))) / len(rays)
    assert field.solid_angle_sr == pytest.approx(4 * np.pi * part, rel=0.02)
    assert ahead[field.contains(ahead, Meter(CORTEX_M3)), 2].min() < field.smallest_cosine + 0.01
