from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.camera.common.hazards.contract import SensorHazard
from cubestack.emulator.camera.common.hazards.lenses import (
    Defocus,
    FocalLength,
    LensResiduals,
    PixelAspect,
    PixelSkew,
    PrincipalPoint,
    RadialDistortion,
    Wobble,
)
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.residual import displace
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS
from cubestack.emulator.camera.mt9m001.lens import CONDITION as ARAMIS
from cubestack.emulator.camera.ov7620.view import FisheyeCondition
from cubestack.emulator.scene.file import SceneError

GRID = np.stack(np.meshgrid(np.linspace(0, 1023, 41), np.linspace(0, 511, 31)), -1).reshape(-1, 2)


def lens(
    *hazards: SensorHazard, condition: SkyCondition = CONDITION, celsius: float = 20
) -> Optics:
    return replace(condition, hazards=hazards, temperature_c=celsius).lens


def test_optics_are_unchanged_without_hazards() -> None:
    assert CONDITION.lens is LENS
    assert lens(Defocus(), FocalLength()) is LENS  # in focus and as long as it should be at 20 C


@pytest.mark.parametrize("percent", [-3.0, 0.5, 1.0])
def test_focal_length_moves_stars_away_from_the_principal_point(percent: float) -> None:
    stars = LENS.unproject(GRID)
    centre = np.array([LENS.cx, LENS.cy])
    moved = lens(FocalLength(percent=percent)).project(stars)
    np.testing.assert_allclose(moved - centre, (GRID - centre) * (1 + percent / 100), atol=1e-8)


def test_focal_length_follows_the_temperature() -> None:
    warm = lens(FocalLength(ppm_per_k=50.0), celsius=60)
    assert warm.focal_length_mm == pytest.approx(6.28 * 1.002)


def test_sampled_focal_length_errors_have_both_signs() -> None:
    placed = {FocalLength.sample(1, None, np.random.default_rng(s)).percent for s in range(20)}
    assert placed == {-1, 1}


@pytest.mark.parametrize(("condition", "f", "pitch"), [(CONDITION, 1.256, 5.6), (ARAMIS, 1.2, 5.2)])
def test_temperature_defocus_follows_the_width_of_the_light_cone(
    condition: SkyCondition, f: float, pitch: float
) -> None:
    # 40 um before the focus; the standard deviation of an even disc, along one axis: radius / 2.
    blurred = lens(Defocus(um_per_k=1.0), condition=condition, celsius=60)
    disc = 40 / f / 2 / 2 / pitch
    own = condition.optics.psf_sigma_px
    assert blurred.psf_sigma_px == pytest.approx(np.hypot(own, disc), rel=0.01)


def test_defocus_width_replaces_the_spot_width() -> None:
    assert lens(Defocus(sigma_px=3.0), celsius=60).psf_sigma_px == 3


@pytest.mark.parametrize("seed", range(4))
def test_lens_residuals_have_their_rms_without_rotation_or_scale(seed: int) -> None:
    crooked = lens(LensResiduals(rms_px=0.5, seed=seed))
    y, x = np.mgrid[0:512:8, 0:1024:8]
    pixels = np.stack([x.ravel(), y.ravel()], 1) + 3.5
    by = crooked.project(LENS.unproject(pixels)) - pixels
    assert np.sqrt((by**2).sum(axis=1).mean()) == pytest.approx(0.5, rel=0.01)
    plane = np.column_stack([pixels, np.ones(len(pixels))])
    fitted = plane @ np.linalg.lstsq(plane, by, rcond=None)[0]
    assert np.abs(fitted).max() < 0.02


@pytest.mark.parametrize("condition", [CONDITION, ARAMIS])
def test_wrong_shapes_move_stars_by_their_definition(condition: SkyCondition) -> None:
    own = condition.optics
    middle = np.array([own.cx, own.cy])
    stars, away = own.unproject(GRID), GRID - middle
    half = np.hypot(own.columns, own.rows) / 2
    for hazard, moved in (
        (PixelAspect(percent=2.0), away * (0.02, 0)),
        (PixelSkew(percent=1.0), None),
        (PrincipalPoint(px=10.0, direction_deg=90.0), np.full_like(away, (0, 10))),
        (RadialDistortion(px=5.0), None),
    ):
        seen = lens(hazard, condition=condition).project(stars)
        if moved is None:  # given at the place that is seen
            shifted = seen - middle
            square = np.sum(shifted * shifted, axis=1, keepdims=True)
            skew = np.stack([0.01 * shifted[:, 1], np.zeros(len(shifted))], axis=1)
            radial = 5 * square * shifted / half**3
            moved = skew if isinstance(hazard, PixelSkew) else radial
        np.testing.assert_allclose(seen, GRID + moved, atol=1e-7)


def test_wobble_moves_rows_alike_and_by_its_size_at_most() -> None:
    shaken = lens(Wobble(px=3.0, seed=4))
    by = shaken.project(LENS.unproject(GRID)) - GRID
    assert 2.9 < np.hypot(*by.T).max() <= 3.0
    restored = shaken.unproject(GRID + by)
    np.testing.assert_allclose(restored, LENS.unproject(GRID), atol=1e-9)


def test_residuals_can_be_undone() -> None:
    crooked = lens(LensResiduals(rms_px=2.0, seed=1), FocalLength(percent=1.0))
    np.testing.assert_allclose(crooked.project(crooked.unproject(GRID)), GRID, atol=1e-9)


def test_rejects_combined_hazards_beyond_the_limits() -> None:
    with pytest.raises(SceneError, match=r"spot at 60 C must be at most 20 px, not 71"):
        replace(CONDITION, hazards=(Defocus(um_per_k=50.0),), temperature_c=60.0)
    twice = (FocalLength(percent=10.0), FocalLength(percent=5.0))
    with pytest.raises(SceneError, match=r"must be 0.85 to 1.15 of the nominal one, not 1.1[56]"):
        replace(CONDITION, hazards=twice)
    with pytest.raises(SceneError, match=r"must be 0.85 to 1.15 of the nominal one, not 1.1[56]"):
        FisheyeCondition(hazards=twice)


def test_star_outside_the_lens_does_not_affect_others() -> None:
    residuals = lens(LensResiduals(rms_px=2.0, seed=1)).residuals
    with_nan = np.concatenate([[[np.nan, np.nan]], GRID])
    np.testing.assert_array_equal(displace(with_nan, residuals)[1:], displace(GRID, residuals))
