"""The 320 faces: what the construction promises, whoever numbers them."""

import numpy as np
import pytest

from cubestack.firmware_model.aramis.catalogue.geodesic import NO_FACE, geodesic_sphere

from ..sky import meter

SPHERE = geodesic_sphere()
CENTRES = SPHERE.centres.astype(np.float64)


def directions(count: int, seed: int = 0) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.mark.parametrize(("splits", "faces"), [(0, 20), (1, 80), (2, 320)])
def test_each_split_makes_four_of_one(splits: int, faces: int) -> None:
    assert len(geodesic_sphere(splits)) == faces


@pytest.mark.parametrize("splits", [-1, 5])
def test_rejects_splits_out_of_range(splits: int) -> None:
    with pytest.raises(ValueError, match=f"splits must be 0 to 4, not {splits}"):
        geodesic_sphere(splits)


def test_faces_come_in_opposite_pairs() -> None:
    opposite = CENTRES @ -CENTRES.T
    np.testing.assert_allclose(opposite.max(axis=1), 1, atol=1e-6)


def test_centres_are_spread_evenly() -> None:
    """Regions of nearest centre take between 0.7 and 1.4 of their share of the sphere."""
    nearest = np.argmax(directions(64_000) @ CENTRES.T, axis=1)
    share = np.bincount(nearest, minlength=320) / 200
    assert 0.7 < share.min() < share.max() < 1.4


def test_sixty_faces_at_the_twelve_corners_have_eleven_neighbours() -> None:
    assert SPHERE.neighbours.shape == (320, 12)
    counts = (SPHERE.neighbours != NO_FACE).sum(axis=1)
    assert sorted(set(counts.tolist())) == [11, 12]
    assert (counts == 11).sum() == 12 * 5


def test_neighbours_are_mutual_near_and_no_face_is_its_own() -> None:
    for face, row in enumerate(SPHERE.neighbours):
        others = row[row != NO_FACE]
        assert face not in others
        assert len(set(others.tolist())) == len(others)
        assert all(face in SPHERE.neighbours[other] for other in others)
        nearest = np.argsort(-(CENTRES @ CENTRES[face]))[1 : 1 + 3]
        assert set(nearest.tolist()) <= set(others.tolist())


def test_a_direction_lies_in_the_face_with_the_nearest_centre() -> None:
    spent = meter()
    for vector in directions(200, 1):
        face = SPHERE.face_of(vector.astype(np.float32), spent)
        assert CENTRES[face] @ vector >= (CENTRES @ vector).max() - 1e-6
    assert spent.counts["f32_mul"] == 200 * 3 * 320


def test_the_faces_around_hold_every_direction_within_half_a_field() -> None:
    """What section 5.9 asks of the size of the faces: half a field of 21.5 deg from a boresight
    anywhere in the face."""
    rng = np.random.default_rng(2)
    for boresight in directions(300, 3):
        marked = SPHERE.around(boresight.astype(np.float32), meter())
        assert 12 <= marked.sum() <= 13
        aside = np.cross(boresight, rng.normal(size=(50, 3)))
        aside /= np.linalg.norm(aside, axis=1, keepdims=True)
        angle = np.radians(21.53 / 2)
        around = np.cos(angle) * boresight + np.sin(angle) * aside
        assert marked[np.argmax(around @ CENTRES.T, axis=1)].all()
