"""Parts of the sky with few stars, beside the real sky."""

import numpy as np
from scipy.spatial.transform import Rotation

from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.firmware_model.star_tracker.observation import so_few

from ..cubestar.sky import meter, pinhole


def test_probability_of_few_stars_is_not_underestimated() -> None:
    stars, view, counts = load_sky(mag_limit=3.8).vectors, pinhole(), []
    for attitude in Rotation.random(3000, random_state=1).as_matrix():
        camera = stars @ attitude.T
        ahead = camera[camera[:, 2] > view.smallest_cosine].astype(np.float32)
        counts.append(np.count_nonzero(view.contains(ahead, meter())))
    for few in range(3, 12):
        claimed = so_few(few, len(stars), view.solid_angle_sr)
        measured = np.mean(np.array(counts) <= few)
        assert measured < claimed + 3 * np.sqrt(claimed / len(counts))
