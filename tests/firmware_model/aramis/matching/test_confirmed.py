"""Attitudes that further stars confirm: what is believed, how sure it is, and when it is over."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.aramis.matching import confirmed
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.pipeline import VERIFIED
from cubestack.firmware_model.aramis.solution import Solution, StarList
from cubestack.firmware_model.attitude.quest import AttitudeError
from cubestack.firmware_model.interface.aramis import Reason

from ..sky import FIELD, Light, Picture, database, meter, pictures

PROFILE = VERIFIED.profile


def found(made: Picture, stars: StarList | None = None, noise_px: float = 0.1) -> Solution:
    stars = stars or made.stars
    sigma = np.full(len(stars), noise_px, np.float32)
    return identify(replace(stars, sigma_px=sigma), FIELD, PROFILE, database(), meter())


@pytest.mark.parametrize("noise_px", [0.05, 0.2, 0.5])
def test_its_errors_are_what_it_claims(noise_px: float) -> None:
    inside = []
    for made in pictures(60, 7, Light(noise_px=noise_px)):
        solution = found(made, noise_px=noise_px)
        if solution.quaternion is None:
            continue
        assert solution.rating is not None
        turn = Rotation.from_quat(solution.quaternion.astype(np.float64)) * made.attitude.inv()
        inside.append(np.abs(turn.as_rotvec()) < solution.rating.sigma_rad)
    assert len(inside) > 50
    assert 0.55 < np.mean(inside) < 0.85


def test_a_focal_length_that_is_right_is_left_alone() -> None:
    scales = [found(made).rating.scale for made in pictures(15, 10)]  # type: ignore[union-attr]
    assert scales.count(1.0) >= 13


def test_a_triangle_alone_is_not_believed() -> None:
    for made in pictures(5, 11, Light(false_stars=20, most=60)):
        known = np.flatnonzero(np.isin(made.hip, database().numbers))[:3]
        false = np.flatnonzero(made.hip == 0)
        kept = np.sort(np.concatenate([known, false]))
        stars = StarList(made.stars.centroids[kept], made.stars.brightness[kept])
        assert found(made, stars).reason is Reason.UNCONFIRMED


def test_it_is_given_up_when_time_is_over() -> None:
    (made,) = pictures(1, 12, Light(mag_limit=-2.0, false_stars=40, most=60))
    spent = meter()
    short = replace(PROFILE, within_ms=20.0)
    solution = identify(made.stars, FIELD, short, database(), spent)
    assert solution.reason is Reason.NO_TIME
    assert 0.02 <= spent.table.seconds(spent.total) < 0.03


def test_rejects_uncertain_rotation() -> None:
    made = pictures(1, 14)[0]
    strict = replace(PROFILE, largest_sigma_rad=1e-6)
    solution = identify(made.stars, FIELD, strict, database(), meter())
    assert (solution.quaternion, solution.reason) == (None, Reason.UNCONFIRMED)


def test_stars_that_determine_no_attitude_confirm_none(monkeypatch: pytest.MonkeyPatch) -> None:
    (made,) = pictures(1, 15, Light(most=6))

    def undetermined(*_given: object, **_more: object) -> None:
        raise AttitudeError("the vectors all point the same way")

    assert found(made).reason is Reason.CONFIRMED
    monkeypatch.setattr(confirmed, "robust_fit", undetermined)
    solution = found(made)
    assert (solution.quaternion, solution.reason) == (None, Reason.UNCONFIRMED)
