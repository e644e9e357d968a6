"""The search for an attitude, over both catalogues: what is believed, and what is not."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.attitude.geometry import scaled
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from tests.tiers import quick

from .trackers import PairTracker, Tracker, TripleTracker

MIRROR = np.array([-1, 1, 1], np.float32)


@pytest.fixture(scope="module", params=["pairs", "triples"])
def tracker(request: pytest.FixtureRequest, catalogue: StarCatalogue, shoot: Any) -> Tracker:
    return PairTracker(catalogue, shoot) if request.param == "pairs" else TripleTracker()


def near(boresight: NDArray[np.float64], deg: float, rng: np.random.Generator) -> Any:
    axis: NDArray[np.float64] = np.cross(boresight, rng.normal(size=3))
    turn = Rotation.from_rotvec(np.radians(deg) * axis / np.linalg.norm(axis))
    return np.asarray(turn.apply(boresight), dtype=np.float32)


@pytest.mark.parametrize(
    ("hint_deg", "false_stars", "least"),
    quick([(None, 5, 0.98), (None, 0, 0.98), (None, 20, 0.95), (5.0, 20, 0.95), (5.0, 0, 0.98)], 2),
)
def test_search_solves_nearly_all_skies_and_is_never_wrong(
    tracker: Tracker, hint_deg: float | None, false_stars: int, least: float
) -> None:
    rng = np.random.default_rng((10 if hint_deg is None else 30) + false_stars)
    solved = 0
    for _ in range(60):
        sky = tracker.sky(rng, false_stars)
        hint = None if hint_deg is None else near(sky.boresight, hint_deg, rng)
        solved += tracker.identify(sky.directions, hint=hint).is_right(sky.stars)
    assert solved >= least * 60


def test_hint_in_the_opposite_direction_identifies_nothing(tracker: Tracker) -> None:
    rng = np.random.default_rng(50)
    for _ in range(4):
        sky = tracker.sky(rng)
        found = tracker.identify(sky.directions, hint=-sky.boresight.astype(np.float32))
        assert found.outcome != "IDENTIFIED"


@pytest.mark.parametrize("count", quick([20, 10, 5, 40], 1))
def test_false_stars_are_not_identified(tracker: Tracker, count: int) -> None:
    rng = np.random.default_rng(60 + count)
    for _ in range(6):
        assert (tracker.identify(tracker.false_rays(rng, count)).stars == -1).all()


def test_rejects_mirrored_sky(tracker: Tracker) -> None:
    rng = np.random.default_rng(70)
    outcomes = []
    for _ in range(3):
        found = tracker.identify(tracker.sky(rng).directions * MIRROR)
        assert (found.stars == -1).all()
        outcomes.append(found.outcome)
    expected = "MIRRORED" if isinstance(tracker, PairTracker) else "UNCONFIRMED"
    assert outcomes.count(expected) >= 2


def test_rejects_too_few_stars(tracker: Tracker) -> None:
    for count in range(tracker.fewest):
        found = tracker.identify(np.tile(np.array([[0, 0, 1]], np.float32), (count, 1)))
        assert found.outcome == "TOO_FEW_CENTROIDS"
        assert found.stars.tolist() == [-1] * count


def test_false_stars_never_change_an_identity(tracker: Tracker) -> None:
    rng = np.random.default_rng(82)
    for _ in range(20):
        sky = tracker.sky(rng)
        more = np.concatenate([sky.directions[:20], tracker.false_rays(rng, 15)])
        real, stars = tracker.identify(more).stars[: len(sky.stars[:20])], sky.stars[:20]
        named = (real != -1) & (stars != -1)
        assert (real[named] == stars[named]).all()


@pytest.mark.parametrize("scale", quick([0.97, 0.995, 1.01, 1.03], 1))
def test_identification_measures_the_focal_length_error(tracker: Tracker, scale: float) -> None:
    rng = np.random.default_rng(83)
    solved = 0
    for _ in range(6):
        sky = tracker.sky(rng)
        found = tracker.identify(scaled(sky.directions, scale, tracker.meter()))
        solved += found.is_right(sky.stars)
        if np.count_nonzero(found.stars != -1) >= 6:
            assert found.scale == pytest.approx(scale, abs=0.002)
    assert solved >= (5 if abs(scale - 1) < 0.02 else 4)


def test_identified_attitude_has_false_alarm_rate_and_scale(tracker: Tracker) -> None:
    rng = np.random.default_rng(94)
    for _ in range(10):
        sky = tracker.sky(rng)
        found = tracker.identify(sky.directions)
        assert 0 <= found.false_alarm <= 1e-4
        assert np.count_nonzero(found.stars != -1) <= found.expected + 1
        assert found.scale == pytest.approx(1, abs=0.001)


@pytest.mark.parametrize("count", [12, 24, 60])
def test_search_ends_within_its_time_limit(tracker: Tracker, count: int) -> None:
    meter = tracker.meter()
    found = tracker.identify(tracker.false_rays(np.random.default_rng(96), count), meter)
    assert meter.table.seconds(meter.total) <= tracker.limit_s
    assert sum(meter.phases.values()) > 0.9 * meter.total
    assert found.outcome in ("NO_TIME", "UNCONFIRMED")


def test_adjacent_stars_get_different_identities(tracker: Tracker) -> None:
    sky = tracker.sky(np.random.default_rng(99))
    known = int(np.flatnonzero(sky.stars != -1)[2])
    twin = sky.directions[known] + np.array([3e-4, 0, 0], np.float32)
    rays = np.vstack([sky.directions[:30], twin / np.linalg.norm(twin)]).astype(np.float32)
    named = [star for star in tracker.identify(rays).stars.tolist() if star != -1]
    assert len(set(named)) == len(named) >= 4
