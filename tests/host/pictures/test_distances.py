"""How far a label is from a mark."""

import pytest

from cubestack.host.pictures.labels import Box, Wanted, distance

BOX = Box(10, 20, 40, 30)


@pytest.mark.parametrize(
    ("x", "y", "away"),
    [
        *((25, 25, 0), (10, 20, 0), (40, 30, 0), (9, 25, 1), (41, 25, 1), (25, 19, 1)),
        *((25, 31, 1), (7, 16, 5), (43, 34, 5), (7, 34, 5), (43, 16, 5), (40.5, 25, 0.5)),
    ],
)
def test_it_is_that_of_the_nearest_edge(x: float, y: float, away: float) -> None:
    assert distance(BOX, Wanted(x, y, 1.0, 30.0, 10.0)) == pytest.approx(away)
