import numpy as np

from cubestack.firmware_model.aramis.matching.identification import sides_agree

from ..sky import meter


def test_sides() -> None:
    vectors = np.array([[0, 0, 1], [0.1, 0, 1], [0, 0.2, 1]], dtype=np.float32)
    for star in range(3):
        moved = vectors.copy()
        moved[star, 0] += 1e-3
        assert not sides_agree(vectors, moved, 2e-4, meter())
        assert sides_agree(vectors, moved, 2e-3, meter())
    turned = vectors[:, [1, 2, 0]]
    assert sides_agree(vectors, turned, 1e-5, meter())
    assert not sides_agree(vectors, np.full((3, 3), np.nan, dtype=np.float32), 1, meter())


def test_a_mirror_image_does_not_agree() -> None:
    """An isosceles triangle with two stars exchanged: its sides are the same."""
    vectors = np.array([[0, 0, 1], [0.1, 0.1, 1], [-0.1, 0.1, 1]], dtype=np.float32)
    assert sides_agree(vectors, vectors, 1e-6, meter())
    assert not sides_agree(vectors, vectors[[0, 2, 1]], 1e-3, meter())
