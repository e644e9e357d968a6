import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.catalogue import PAIR_LIMIT_DEG, onboard_catalogue
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.hipparcos import CATALOGUE_EPOCH

ALPHA_CENTAURI = {71681: "B", 71683: "A"}


def test_published_number_of_stars() -> None:
    listed = set(onboard_catalogue().hip.tolist())
    assert len(listed) == 405
    assert [ALPHA_CENTAURI[hip] for hip in listed & ALPHA_CENTAURI.keys()] == ["A"]


@pytest.mark.parametrize(("one", "other", "apart"), [(31, 401, 0.695071), (32, 92, 0.700600)])
def test_published_numbers_and_distances_of_stars(one: int, other: int, apart: float) -> None:
    # Table 4.3, where stars are counted from 1; alpha Centauri is between stars 92 and 401.
    listed = onboard_catalogue(epoch=CATALOGUE_EPOCH)
    first, second = listed.vectors[[one - 1, other - 1]].astype(float)
    assert np.arccos(first @ second) == pytest.approx(apart, abs=1e-6)


def test_lists_every_pair_within_a_field() -> None:
    x, y = LENS.columns - 0.5, LENS.rows - 0.5
    corners = LENS.unproject(np.array([[-0.5, -0.5], [x, -0.5], [-0.5, y], [x, y]]))
    diagonal = np.degrees(np.arccos(np.clip(corners @ corners.T, -1, 1))).max()
    assert diagonal < PAIR_LIMIT_DEG == pytest.approx(diagonal, abs=0.1)


def test_compiling_twice_gives_the_same_file() -> None:
    first, again = onboard_catalogue(3.0), onboard_catalogue.__wrapped__(3.0)
    assert first is not again
    np.testing.assert_array_equal(first.vectors, again.vectors)
    np.testing.assert_array_equal(first.pairs.angle, again.pairs.angle)
