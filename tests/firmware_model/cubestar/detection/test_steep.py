"""Stars beside the Earth's limb, which no level between cells tells, and no stars on it."""

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import (
    DetectionConfig,
    SearchEnd,
    detect_stars,
    steep,
)
from cubestack.firmware_model.cubestar.detection.spots import ELECTRONS_PER_DN, HALF
from cubestack.firmware_model.cubestar.detection.steep import along_rows, beside
from cubestack.firmware_model.star_tracker.background import UNIT, SkyBackground
from tests.together import together

from ..sky import meter
from .pictures import Places, spots, taken

CONFIG = DetectionConfig(background=True)
Y, X = np.mgrid[0:512, 0:1024]
NEAR_PX = 1.0


def limb(angle_deg: float, height_px: float = 5.0) -> tuple[NDArray[np.float64], Places]:
    """Light beyond a line through the middle, which falls by 1/e in ``height_px`` above it, and
    places that are from 2.5 to 8 times as far from where it is at the end of the scale."""
    angle = np.radians(angle_deg)
    along = np.array([-np.sin(angle), np.cos(angle)])
    up = np.array([np.cos(angle), np.sin(angle)])
    height = (X - 512) * up[0] + (Y - 256) * up[1]
    light = 255 * np.exp(-np.maximum(height, -20) / height_px)
    steps = np.linspace(-230, 230, 12)
    places = (
        np.array([512, 256])
        + steps[:, None] * along
        + height_px * np.linspace(2.5, 8, 12)[:, None] * up
    )
    return light, places


def noisy(image: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    light: NDArray[np.float64] = rng.poisson(image * ELECTRONS_PER_DN) / ELECTRONS_PER_DN
    return light + rng.normal(0, 0.3, image.shape)


@pytest.mark.parametrize("other", range(10, 15))
def test_background_of_a_spot_is_the_mean_level_beside_it_rounded_half_up(other: int) -> None:
    away = HALF + 1
    picture = np.zeros((9, 32), np.uint8)
    picture[4, [16 - away, 16, 16 + away]] = 10, 200, other
    marks = np.zeros(picture.shape, np.bool_)
    marks[4, 16] = True
    dark = SkyBackground(np.zeros((2, 2), np.int64), np.zeros((2, 2), np.int64), 0.0)
    places = along_rows(picture, marks, dark, UNIT)
    assert places.levels.tolist() == [UNIT * (10 + (other - 10 + 1) // 2)]


def test_background_samples_are_clipped_at_the_image_border() -> None:
    at = np.array([0, 4, 8])
    none = np.zeros(3, np.int64)
    rows, columns = beside(steep.Places(at, at * 4, none, none), 9, 33)
    assert rows.shape == columns.shape == (6, 3)
    away = HALF + 1
    assert [*rows.min(axis=0), *rows.max(axis=0)] == [0, 0, 8 - away, away, 8, 8]
    assert [*columns.min(axis=0)] == [0, 16 - away, 32 - away]
    assert [*columns.max(axis=0)] == [away, 16 + away, 32]


@pytest.mark.parametrize("angle_deg", [0, 30, 45, 90, 140, 200, 270, 300])
def test_only_stars_are_found_beside_the_limb(angle_deg: float) -> None:
    light, places = limb(angle_deg)
    stars = spots(places, np.full(len(places), 700.0))
    found = detect_stars(taken(noisy(light + stars, angle_deg)), CONFIG, meter())
    away = np.hypot(*(places[:, None] - found.centroids[None]).transpose(2, 0, 1))
    assert found.end is SearchEnd.COMPLETE
    assert np.count_nonzero(away.min(axis=1) < NEAR_PX) >= 11
    assert np.count_nonzero(away.min(axis=0) > NEAR_PX) <= 1


@together("angle_deg", range(0, 360, 20))
def test_earth_limb_yields_at_most_one_false_star(angle_deg: float) -> None:
    light, _ = limb(angle_deg + 7)
    found = detect_stars(taken(noisy(light, angle_deg)), CONFIG, meter())
    assert len(found.centroids) <= 1


def test_saturated_cells_and_cells_outside_the_region_are_blind() -> None:
    light, _ = limb(0)
    picture = taken(noisy(light, 1))
    whole = detect_stars(picture, CONFIG, meter())
    assert whole.blind is not None
    assert whole.blind.shape == (16, 32)
    assert whole.blind[:, :16].all()
    assert not whole.blind[:, 17:].any()
    region = DetectionConfig(background=True, x_start=200, x_end=904, y_start=40, y_end=472)
    part = detect_stars(picture, region, meter())
    assert part.blind is not None
    assert part.blind[[0, -1]].all()
    assert part.blind[:, [*range(16), 29, 30, 31]].all()
    assert not part.blind[2:14, 17:28].any()
