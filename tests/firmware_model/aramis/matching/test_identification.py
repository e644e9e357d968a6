"""From stars to attitudes: the published profile, and the one that verifies.

`host.studies.aramis.stars_alone` measures the same over a thousand attitudes.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.matching.identification import (
    identify,
    largest_eigenvalue,
    quartic,
    sides_agree,
)
from cubestack.firmware_model.aramis.pipeline import PUBLISHED, VERIFIED
from cubestack.firmware_model.aramis.solution import NONE, Profile, Solution, StarList
from cubestack.firmware_model.attitude.quest import quest
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason
from cubestack.host.studies.aramis.sky import (
    FIELD,
    Light,
    Picture,
    database,
    errors_deg,
    meter,
    pictures,
)
from cubestack.host.studies.aramis.stars_alone import COARSE, outcomes
from tests.tiers import quick
from tests.together import together

NOISY = replace(COARSE, noise_px=1.0)
PROFILES = pytest.mark.parametrize("profile", [PUBLISHED.profile, VERIFIED.profile])


def rates(poses: int, *args: Any, **how: Any) -> dict[str, float]:
    """Shares of the poses."""
    counts = outcomes(poses, *args, **how)
    return {name: counts[name] / poses for name in ("right", "wrong", "far")}


def named(stars: StarList, profile: Profile, hint: np.ndarray | None = None) -> Solution:
    return identify(stars, FIELD, profile, database(), meter(), hint)


def run(
    made: Picture, profile: Profile = VERIFIED.profile, hint: np.ndarray | None = None
) -> Solution:
    return named(made.stars, profile, hint)


def test_published_profile_is_mostly_right_and_sometimes_wrong() -> None:
    """The thesis has 60 % conclusive results, many of them wrong, with more noise than here."""
    found = rates(120, PUBLISHED.profile)
    assert found["right"] > 0.9
    assert found["wrong"] > 0.005


def test_published_profile_fails_as_published_in_excess_noise() -> None:
    found = rates(120, PUBLISHED.profile, light=NOISY)
    assert 0.5 < found["right"] + found["wrong"] < 0.8
    assert found["wrong"] > 0.1
    assert found["far"] > 0.03


def test_rough_direction_leaves_no_wrong_results() -> None:
    found = rates(120, PUBLISHED.profile, hint_error_deg=2)
    assert found["wrong"] == 0
    assert found["right"] > 0.95


def test_rough_direction_rules_out_far_results_in_noise() -> None:
    """The thesis' own criterion of a true result, in the noise that fails without a direction."""
    found = rates(120, PUBLISHED.profile, light=NOISY, hint_error_deg=2)
    assert found["far"] == 0
    assert found["wrong"] < 0.05
    assert found["right"] > 0.35


@pytest.mark.parametrize(
    ("light", "hint_error_deg", "right", "field"),
    quick(
        [
            (Light(false_stars=5), 2.0, 0.98, FIELD),
            (Light(), None, 0.98, FIELD),
            (Light(false_stars=5), None, 0.98, FIELD),
            (Light(false_stars=5, false_mags=(0, 3)), None, 0.95, FIELD),
            (Light(mag_limit=5, false_stars=5), None, 0.95, FIELD),
            (Light(false_stars=5), None, 0.95, CameraField(fov_deg=18)),
        ],
        2,
    ),
)
def test_verification_accepts_right_solutions(
    light: Light, hint_error_deg: float | None, right: float, field: CameraField
) -> None:
    found = rates(50, VERIFIED.profile, light, hint_error_deg, field, seed=1)
    assert found["wrong"] == 0
    assert found["right"] >= right


def test_confirming_stars_improve_the_attitude_of_a_triangle() -> None:
    triple, all_stars = [], []
    for made in pictures(40, 3):
        plain, verified = run(made, replace(VERIFIED.profile, verify=False)), run(made)
        if plain.quaternion is None or errors_deg(plain.quaternion, made.attitude)[0] > 0.1:
            continue
        triple.append(errors_deg(plain.quaternion, made.attitude))
        all_stars.append(errors_deg(verified.quaternion, made.attitude))
    assert np.median(all_stars, axis=0)[0] < 0.7 * np.median(triple, axis=0)[0]
    assert np.max(all_stars, axis=0)[0] < 0.01


def test_solution_has_outcome_quaternion_and_star_numbers() -> None:
    (made,) = pictures(1, 4)
    solution = run(made)
    expected = MeasurementOutcome.CONCLUSIVE, Reason.CONFIRMED
    assert (solution.outcome, solution.reason) == expected
    assert solution.quaternion[3] >= 0
    assert np.linalg.norm(solution.quaternion) == pytest.approx(1, abs=1e-6)
    known = solution.stars != NONE
    assert (database().numbers[solution.stars[known]] == made.hip[known]).all()
    assert 3 < known.sum() <= solution.expected
    assert solution.triples >= 1
    assert solution.measured is made.stars


@pytest.mark.slow
def test_identification_tolerates_a_wrong_brightness_order() -> None:
    """Verification distinguishes stars by their sides when their brightness misleads."""
    rng = np.random.default_rng(5)
    right = 0
    for made in pictures(30, 5):
        shuffled = rng.permutation(len(made.stars))[:12]
        brightness = np.sort(made.stars.brightness[shuffled])
        stars = StarList(made.stars.centroids[np.sort(shuffled)], brightness)
        solution = named(stars, VERIFIED.profile)
        if solution.quaternion is not None:
            assert errors_deg(solution.quaternion, made.attitude)[0] < 0.1
            right += 1
    assert right > 10


@PROFILES
@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_stars_yield_no_attitude(count: int, profile: Profile) -> None:
    (made,) = pictures(1, 6)
    stars = StarList(made.stars.centroids[:count], made.stars.brightness[:count])
    solution = named(stars, profile)
    assert (solution.outcome, solution.reason) == (MeasurementOutcome.NONE, Reason.TOO_FEW_STARS)


@PROFILES
def test_coinciding_stars_are_refused_as_degenerate(profile: Profile) -> None:
    stars = StarList(np.full((6, 2), 500, dtype=np.float32), np.ones(6, dtype=np.float32))
    solution = named(stars, profile)
    reason = Reason.NO_TRIANGLE if profile.verify else Reason.DEGENERATE
    assert (solution.outcome, solution.reason) == (MeasurementOutcome.NONE, reason)


@PROFILES
@pytest.mark.parametrize("value", [0.0, np.nan])
def test_invalid_direction_gives_no_solution(profile: Profile, value: float) -> None:
    for made in pictures(2, 11):
        solution = run(made, profile, np.full(3, value, dtype=np.float32))
        assert solution.outcome is not MeasurementOutcome.CONCLUSIVE


@PROFILES
def test_hint_in_the_opposite_direction_yields_no_solution(profile: Profile) -> None:
    for made in pictures(4, 7):
        solution = run(made, profile, -made.boresight.astype(np.float32))
        assert solution.outcome is not MeasurementOutcome.CONCLUSIVE


def test_rejects_attitude_far_from_the_hint() -> None:
    """The faces around a direction reach farther than its tolerance."""
    rng = np.random.default_rng(8)
    strict = replace(VERIFIED.profile, hint_tolerance_deg=1.0)
    loose = replace(VERIFIED.profile, hint_tolerance_deg=5.0)
    for made in pictures(4, 8):
        hint = made.hint(2.0, rng)
        assert run(made, strict, hint).outcome is MeasurementOutcome.NONE
        assert run(made, loose, hint).outcome is MeasurementOutcome.CONCLUSIVE


def test_published_profile_ends_with_the_reasons_of_matching() -> None:
    reasons = {run(made, PUBLISHED.profile).reason for made in pictures(100, 9, Light(noise_px=1))}
    assert reasons >= {Reason.UNIQUE, Reason.NO_SHARED_PAIR}


def test_identification_phases_add_up_to_the_total() -> None:
    (made,), spent = pictures(1, 10), meter()
    identify(made.stars, FIELD, VERIFIED.profile, database(), spent, made.boresight)
    assert set(spent.phases) >= {"faces", "triangles", "search", "verification", "attitude"}
    assert 0.9 * spent.total < sum(spent.phases.values()) <= spent.total
    assert spent.table.seconds(spent.total) < 0.1


@pytest.mark.parametrize(
    ("smear_px", "skew_px", "smeared"),
    quick([(9.0, 3.9, True), (12.0, 0.0, True), (9.0, 2.0, False), (3.9, 9.0, False)], 2),
)
@pytest.mark.parametrize("many", quick([True, False], 1))
def test_smear_is_the_reason_only_where_stars_moved_beyond_the_tolerance(
    smear_px: float, skew_px: float, smeared: bool, many: bool
) -> None:
    """Spots that are no sky: 60, or 2, where motion may have hidden the others."""
    count = 60 if many else 2
    places = np.random.default_rng(3).uniform((300, 100), (980, 920), (count, 2))
    bright = np.linspace(900, 100, count).astype(np.float32)
    stars = StarList(places.astype(np.float32), bright, smear_px, skew_px)
    found = identify(stars, FIELD, VERIFIED.profile, database(), meter())
    assert found.outcome is MeasurementOutcome.NONE
    assert (found.reason is Reason.SMEAR) == (smeared if many else smear_px > 4)


@pytest.mark.parametrize("skew_px", [4.1, 13.0])
def test_stars_are_matched_however_long_their_streaks_are(skew_px: float) -> None:
    """The lens may have drawn them: what counts is that they are at their places."""
    for made in pictures(4):
        found = named(replace(made.stars, smear_px=10.0, skew_px=skew_px), VERIFIED.profile)
        assert found.outcome is MeasurementOutcome.CONCLUSIVE
        assert max(errors_deg(found.quaternion, made.attitude)) < 0.2


def test_streaks_with_simultaneous_exposure_get_no_shutter_correction() -> None:
    """No star moved between rows, so the attitude is that of a list without streaks."""
    (made,) = pictures(1)
    smeared = StarList(made.stars.centroids, made.stars.brightness, smear_px=9.0)
    still, drawn_out = (named(one, VERIFIED.profile) for one in (made.stars, smeared))
    assert drawn_out.outcome is MeasurementOutcome.CONCLUSIVE
    np.testing.assert_array_equal(drawn_out.quaternion, still.quaternion)


def test_sides_agree_within_tolerance() -> None:
    vectors = np.array([[0, 0, 1], [0.1, 0, 1], [0, 0.2, 1]], dtype=np.float32)
    for star in range(3):
        moved = vectors.copy()
        moved[star, 0] += 1e-3
        assert not sides_agree(vectors, moved, 2e-4, meter())
        assert sides_agree(vectors, moved, 2e-3, meter())
    turned = vectors[:, [1, 2, 0]]
    assert sides_agree(vectors, turned, 1e-5, meter())
    assert not sides_agree(vectors, np.full((3, 3), np.nan, dtype=np.float32), 1, meter())


def test_mirrored_triangle_does_not_match() -> None:
    """An isosceles triangle with two stars exchanged: its sides are the same."""
    vectors = np.array([[0, 0, 1], [0.1, 0.1, 1], [-0.1, 0.1, 1]], dtype=np.float32)
    assert sides_agree(vectors, vectors, 1e-6, meter())
    assert not sides_agree(vectors, vectors[[0, 2, 1]], 1e-3, meter())


Array = NDArray[np.float64]


def davenport(profile: Array) -> Array:
    odd = profile - profile.T
    z = np.array([[odd[1, 2], odd[2, 0], odd[0, 1]]])
    even = profile + profile.T - np.trace(profile) * np.eye(3)
    return np.block([[even, z.T], [z, np.trace(profile)]])


def unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def profile(rng: np.random.Generator, count: int, noise: float) -> Array:
    body = unit(rng.normal(size=(count, 3)))
    turned = unit(body + rng.normal(0, noise, body.shape))
    inertial = turned @ Rotation.random(random_state=rng).as_matrix()
    return np.asarray(body.T @ inertial / count)


def solutions(body: Array, inertial: Array) -> Array:
    """Quaternions by QUEST with the quartic, and with a root of 1."""
    arguments = [array.astype(np.float32) for array in (body, inertial, np.ones(len(body)))]
    return np.array([quest(*arguments, meter(), eigenvalue=e) for e in (largest_eigenvalue, None)])


@together("seed", range(50))
def test_quartic_is_the_characteristic_polynomial(seed: int) -> None:
    made = profile(np.random.default_rng(seed), 4, 0.5)
    square, linear, constant = quartic(made.astype(np.float32), meter())
    expected = np.poly(davenport(made))
    np.testing.assert_allclose([1, 0, square, linear, constant], expected, atol=2e-6)


@together("seed", range(50))
def test_contradicting_vectors_lower_the_largest_eigenvalue(seed: int) -> None:
    made = profile(np.random.default_rng(seed), 5, 0.3)
    expected = np.linalg.eigvalsh(davenport(made))[-1]
    assert expected < 0.999
    assert largest_eigenvalue(made.astype(np.float32), meter()) == pytest.approx(expected, abs=2e-5)


@together("seed", range(50))
def test_largest_eigenvalue_of_stars_of_one_field_is_1(seed: int) -> None:
    """Their two largest roots are so close that a rounding error taken for a step would cost
    degrees of roll."""
    rng = np.random.default_rng(seed)
    body = unit(np.column_stack([rng.uniform(-0.13, 0.13, (3, 2)), np.ones(3)]))
    inertial = body @ Rotation.random(random_state=rng).as_matrix()
    body = unit(body + rng.normal(0, 4e-5, body.shape))
    made = (body.T @ inertial / 3).astype(np.float32)
    assert largest_eigenvalue(made, meter()) == 1
    np.testing.assert_array_equal(*solutions(body, inertial))


@together("seed", range(50))
def test_quest_with_the_quartic_solves_wahbas_problem(seed: int) -> None:
    """With vectors that agree within degrees, where a root of 1 would be wrong."""
    rng = np.random.default_rng(seed)
    body = unit(rng.normal(size=(6, 3)))
    inertial = body @ Rotation.random(random_state=rng).as_matrix()
    body = unit(body + rng.normal(0, 0.1, body.shape))
    best, _ = Rotation.align_vectors(body, inertial)
    found, plain = Rotation.from_quat(solutions(body, inertial)) * best.inv()
    assert found.magnitude() < min(5e-5, plain.magnitude())


def test_largest_eigenvalue_ends_for_zero_and_nan_matrices() -> None:
    assert 0 <= largest_eigenvalue(np.zeros((3, 3), dtype=np.float32), meter()) <= 1
    assert not largest_eigenvalue(np.full((3, 3), np.nan, dtype=np.float32), meter()) > 1
