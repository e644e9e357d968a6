import numpy as np
import pytest

from cubestack.host.studies.compare.skies import CASES, EXACT, Case, take_image
from cubestack.host.studies.compare.tracker import Tracker, tracker, trackers

FEW = 1  #: a sky with fewer stars than an image can have


def test_an_exact_sky_is_the_catalogue_at_the_attitude(star_tracker: Tracker) -> None:
    image = take_image(star_tracker, EXACT, 3, FEW)
    ahead = star_tracker.stars @ image.attitude.T
    nearest = np.linalg.norm(image.rays[:, None] - ahead, axis=2).min(axis=1)
    assert len(image.rays) > 3
    assert nearest.max() < 1e-6  # also alpha Centauri B, which is in the spot of A
    assert (np.diff(image.brightness) <= 0).all()


def test_cases_of_a_sky_differ_by_their_disturbance_only(star_tracker: Tracker) -> None:
    plain = take_image(star_tracker, CASES[0], 3, FEW)
    false = take_image(star_tracker, Case("false", false=3), 3, FEW)
    assert len(false.rays) == len(plain.rays) + 3
    assert {*map(bytes, plain.rays)} < {*map(bytes, false.rays)}
    noisy = take_image(star_tracker, Case("noise", noise=3.0), 3, FEW)
    exact = take_image(star_tracker, EXACT, 3, FEW)
    assert noisy.pixels - exact.pixels == pytest.approx(3 * (plain.pixels - exact.pixels), abs=1e-3)
    missing = take_image(star_tracker, Case("missing", missing=0.5), 3, FEW)
    assert {*map(bytes, missing.rays)} < {*map(bytes, plain.rays)}


def test_noise_is_that_of_the_sensor(star_tracker: Tracker) -> None:
    apart = [
        take_image(star_tracker, CASES[0], 3, number).pixels
        - take_image(star_tracker, EXACT, 3, number).pixels
        for number in range(30)
    ]
    assert np.concatenate(apart).std() == pytest.approx(star_tracker.noise_px, rel=0.1)


def test_skies_follow_from_the_seed(star_tracker: Tracker) -> None:
    one, same = (take_image(star_tracker, CASES[3], 3, 7) for _ in range(2))
    assert (one.rays == same.rays).all()
    other = take_image(star_tracker, CASES[3], 4, 7)
    assert not np.array_equal(other.attitude, one.attitude)


def test_only_star_trackers_are_compared() -> None:
    assert {"cubestar", "aramis"} <= set(trackers())
    with pytest.raises(ValueError, match="cubesense has no star tracker to compare; there are"):
        tracker("cubesense")
