import numpy as np
import pytest

from cubestack.emulator.boards.aramis.catalogue import onboard_database
from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare import quadtree
from cubestack.host.studies.compare.database import Catalogue, MeasuredAngles
from cubestack.host.studies.compare.skies import EXACT, take_image


@pytest.mark.parametrize("limit_deg", [3.0, 40.0, 120.0])
def test_quadtree_finds_the_pairs_that_all_comparisons_find(limit_deg: float) -> None:
    vectors = np.random.default_rng(1).normal(size=(150, 3))
    vectors[:3] = [[0, 0, 1], [0, 0, -1], [1, 0, 0]]  # corners of the faces
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    first, second, _ = quadtree.pairs(vectors, np.radians(limit_deg))
    near = np.triu(vectors @ vectors.T > np.cos(np.radians(limit_deg)), 1)
    assert {*zip(first.tolist(), second.tolist(), strict=True)} == {
        tuple(pair) for pair in np.argwhere(near).tolist()
    }


def test_quadtree_looks_at_few_stars_for_a_narrow_field() -> None:
    vectors = np.random.default_rng(1).normal(size=(1000, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    _, _, looked_at = quadtree.pairs(vectors, np.radians(5))
    assert looked_at < 1000 * 1000 / 10


def test_pairs_are_those_of_the_firmware(cubestar: Catalogue) -> None:
    own, firmware = cubestar.pairs, onboard_catalogue().pairs
    assert len(own.angle) == len(firmware)
    assert np.abs(own.angle - firmware.angle).max() < 1e-6


@pytest.mark.slow
def test_triangles_are_those_of_the_firmware(aramis: Catalogue) -> None:
    found, database = aramis.triangles, onboard_database()
    # Sides at the limit may fall on either of its sides.
    ours, theirs = (
        rows.astype(np.int64) @ [1 << 32, 1 << 16, 1] for rows in (found, database.stars)
    )
    assert len(np.setxor1d(ours, theirs)) <= 1e-4 * len(theirs)


def test_an_angle_is_charged_once(cubestar: Catalogue) -> None:
    image = take_image(cubestar.tracker, EXACT, 3, 0)
    meter = Meter(cubestar.tracker.table)
    measured = MeasuredAngles(image.rays, meter)
    assert meter.total == 0
    assert measured(0, 1) == measured(1, 0)
    assert meter.counts["f32_acos"] == 1
