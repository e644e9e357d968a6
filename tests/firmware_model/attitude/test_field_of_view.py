import numpy as np
import pytest

from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.firmware_model.attitude.field_of_view import FieldOfView, field_of_view
from cubestack.firmware_model.attitude.geometry import CameraParameters
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter

COLUMNS, ROWS = 1024, 512
NEAR_PX = 2.0


def calibrated(lens: Optics) -> FieldOfView:
    names = ("focal_length_mm", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
    return field_of_view(CameraParameters(**{n: getattr(lens, n) for n in names}), COLUMNS, ROWS)


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


def test_it_ends_at_the_outer_edges_of_the_pixels() -> None:
    focal_px, middle = 1000.0, np.array([COLUMNS / 2, ROWS / 2]) - 0.5
    camera = CameraParameters(6.0, focal_px, focal_px, *middle, 0, 0, 0, 0, pitch_mm=0.006)
    field = field_of_view(camera, COLUMNS, ROWS)
    for corner in ([-0.5, -0.5], [COLUMNS - 0.5, ROWS - 0.5]):
        inwards = np.sign(middle - corner)
        for axis in ([1, 0], [0, 1]):
            pixels = corner + 9 * inwards + np.outer([-8.8, -9.2], inwards) * axis
            rays = np.column_stack([(pixels - middle) / focal_px, np.ones(2)]).astype(np.float32)
            assert field.contains(rays, Meter(CORTEX_M3)).tolist() == [True, False]


def test_its_solid_angle_is_the_part_of_the_sphere() -> None:
    rng = np.random.default_rng(2)
    rays = rng.normal(size=(400_000, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    field = calibrated(LENS)
    ahead = rays[rays[:, 2] >= field.smallest_cosine].astype(np.float32)
    part = np.count_nonzero(field.contains(ahead, Meter(CORTEX_M3))) / len(rays)
    assert field.solid_angle_sr == pytest.approx(4 * np.pi * part, rel=0.02)
    assert ahead[field.contains(ahead, Meter(CORTEX_M3)), 2].min() < field.smallest_cosine + 0.01


def test_nothing_is_seen_in_blind_cells_and_the_field_is_that_much_smaller() -> None:
    field = calibrated(LENS)
    cell = 64
    blind = np.zeros((ROWS // cell, COLUMNS // cell), np.bool_)
    blind[2:5, 3:9] = blind[7, 15] = True
    seen = field.without(blind)
    share = 1 - np.count_nonzero(blind) / blind.size
    assert seen.solid_angle_sr == pytest.approx(share * field.solid_angle_sr)
    assert field.without(np.zeros_like(blind)) is field

    rng = np.random.default_rng(3)
    rays = np.column_stack([rng.uniform([-0.7, -0.5], [0.7, 0.5], (8000, 2)), np.ones(8000)])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    rays = rays[field.contains(rays.astype(np.float32), Meter(CORTEX_M3))]
    across, down = np.nan_to_num(LENS.project(rays), nan=-999.0).T
    inside = (across >= 0) & (across < COLUMNS) & (down >= 0) & (down < ROWS)
    rays, across, down = rays[inside], across[inside], down[inside]
    expected = ~blind[(down / cell).astype(int), (across / cell).astype(int)]
    # The cells follow the field's sides, and the distortion between them by half a cell.
    wrong = expected != seen.contains(rays.astype(np.float32), Meter(CORTEX_M3))
    assert np.count_nonzero(wrong) <= 0.05 * len(rays)
    assert np.count_nonzero(~expected) > 0.1 * len(rays)
