"""How many stars a field sees: table 3.6 of the CubeStar thesis, counted again.

The field is a circle of 42.33 degrees in diameter; the table's caption calls that a radius, and
the text's own field of the lens (table 3.5) shows that it is the diameter.
"""

import numpy as np
import pytest

from cubestack.emulator.scene.hipparcos import load_sky

POSES = 20_000
DIAMETER_DEG = 42.33
EPOCH = 1991.25  # the catalogue's own, as the thesis took it

#: V: percent of pictures with three or more stars, with five or more; mean number of stars.
PUBLISHED = {
    3.0: (84.04, 52.61, 5.71),
    3.2: (90.51, 68.81, 7.04),
    3.4: (93.71, 82.52, 8.55),
    3.6: (99.15, 91.92, 10.61),
    3.8: (99.92, 98.92, 13.52),
    4.0: (100.0, 99.61, 17.10),
}

#: Percent, and stars: the thesis' counts scatter by 0.35 % at most, its magnitudes are not ours.
TOLERANCE = 1.5


def coverage(limit: float, rng: np.random.Generator) -> tuple[float, float, float]:
    """Table columns: counts of stars brighter than ``limit`` around random boresights."""
    boresights = rng.standard_normal((POSES, 3))
    boresights /= np.linalg.norm(boresights, axis=1, keepdims=True)
    cosines = boresights.astype(np.float32) @ load_sky(EPOCH, limit).vectors.T.astype(np.float32)
    seen = np.count_nonzero(cosines > np.cos(np.radians(DIAMETER_DEG / 2)), axis=1)
    return (float(100 * np.mean(seen >= 3)), float(100 * np.mean(seen >= 5)), float(np.mean(seen)))


@pytest.mark.parametrize("limit", PUBLISHED)
def test_sky_coverage_matches_the_published_table(limit: float, rng: np.random.Generator) -> None:
    counted = coverage(limit, rng)
    print(f"V < {limit}: {counted[0]:.2f} % {counted[1]:.2f} % {counted[2]:.2f}")
    assert counted == pytest.approx(PUBLISHED[limit], abs=TOLERANCE)
