from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.detection.mask import LevelHistory, SpikeRemoval
from cubestack.firmware_model.aramis.pipeline import (
    LIMITS,
    PUBLISHED,
    VERIFIED,
    Configuration,
    detect,
)
from cubestack.firmware_model.aramis.pipeline import solve as solve_picture
from cubestack.firmware_model.aramis.solution import Solution, StarList
from cubestack.firmware_model.interface.aramis import MeasurementOutcome, Reason
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.aramis.sky import (
    FIELD,
    Light,
    Picture,
    database,
    errors_deg,
    meter,
    picture,
)

SPOT_PX = 1.5


def render(made: Picture, rng: np.random.Generator, noise: float = 1.5) -> NDArray[np.uint8]:
    """Gaussian spots on a noisy sky of 14 grey levels; magnitude 6 peaks at 20."""
    image = rng.normal(14, noise, (FIELD.rows, FIELD.columns))
    half = 8
    for (x, y), light in zip(made.stars.centroids, made.stars.brightness, strict=True):
        left, top = max(0, int(x) - half), max(0, int(y) - half)
        part = image[top : top + 2 * half + 2, left : left + 2 * half + 2]
        rows, columns = np.mgrid[: part.shape[0], : part.shape[1]]
        square = (columns + left - x) ** 2 + (rows + top - y) ** 2
        part += light / 25 * np.exp(-square / (2 * SPOT_PX**2))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def sky(seed: int) -> tuple[Picture, NDArray[np.uint8]]:
    rng = np.random.default_rng(seed)
    made = picture(rng, FIELD, Light(noise_px=0, mag_noise=0, most=60))
    return made, render(made, rng)


def find(image: NDArray[np.uint8], **settings: Any) -> StarList | None:
    detection = replace(VERIFIED.detection, **settings)
    return detect(image, LevelHistory(), FIELD, detection, meter())


def solve(
    image: NDArray[np.uint8], configuration: Configuration = VERIFIED, spent: Meter | None = None
) -> Solution:
    return solve_picture(image, LevelHistory(), configuration, database(), spent or meter())


def end_of(solution: Solution) -> tuple[MeasurementOutcome, Reason]:
    return solution.outcome, solution.reason


def distances_px(found: StarList, made: Picture) -> NDArray[np.float32]:
    apart = np.linalg.norm(found.centroids[:, None] - made.stars.centroids[None], axis=2)
    return np.asarray(apart.min(axis=1))


@pytest.mark.parametrize("seed", range(4))
def test_attitude_from_an_image_is_within_0_01_deg(seed: int) -> None:
    made, image = sky(seed)
    solution = solve(image)
    assert solution.outcome is MeasurementOutcome.CONCLUSIVE
    cross, roll = errors_deg(solution.quaternion, made.attitude)
    assert cross < 0.01
    assert roll < 0.05


def test_stars_are_found_at_their_true_positions() -> None:
    made, image = sky(5)
    found = find(image)
    assert len(found) > 6
    assert np.median(distances_px(found, made)) < 0.15
    assert (np.diff(found.brightness) <= 0).all()


def test_background_subtraction_improves_centroids() -> None:
    skies = [sky(seed) for seed in range(3)]
    plain, better = (
        [distances_px(find(image, subtract=subtract), made) for made, image in skies]
        for subtract in (False, True)
    )
    assert np.median(np.concatenate(better)) < np.median(np.concatenate(plain))


def test_published_spike_method_finds_fewer_stars() -> None:
    _, image = sky(6)
    methods = SpikeRemoval.WINDOW, SpikeRemoval.CENTRE
    published, other = (len(find(image, spikes=method, max_stars=255)) for method in methods)
    assert 3 <= published < other


def test_detection_ignores_light_outside_the_field() -> None:
    image = np.full((FIELD.rows, FIELD.columns), 10, dtype=np.uint8)
    image[500:510, 20:30] = image[500:510, 640:650] = 200
    found = detect(image, LevelHistory(), FIELD, PUBLISHED.detection, meter())
    np.testing.assert_allclose(found.centroids, [[644.5, 504.5]], atol=0.01)


def test_only_the_brightest_stars_are_kept() -> None:
    assert len(find(sky(7)[1], max_stars=5)) == 5


@pytest.mark.parametrize("configuration", [PUBLISHED, VERIFIED])
@pytest.mark.parametrize("level", [0, 14, 255])
def test_uniform_image_ends_without_an_attitude(configuration: Configuration, level: int) -> None:
    image = np.full((FIELD.rows, FIELD.columns), level, dtype=np.uint8)
    full = level == 255 and configuration is VERIFIED
    reason = Reason.SATURATED if full else Reason.TOO_FEW_STARS
    assert end_of(solve(image, configuration)) == (MeasurementOutcome.NONE, reason)


def test_image_of_only_edges_ends_with_too_many_pixels() -> None:
    image = np.zeros((FIELD.rows, FIELD.columns), dtype=np.uint8)
    image[:, ::8] = 255
    image[::2] = 0
    off = replace(PUBLISHED, detection=replace(PUBLISHED.detection, spikes=SpikeRemoval.OFF))
    assert end_of(solve(image, off)) == (MeasurementOutcome.NONE, Reason.TOO_MANY_PIXELS)


@pytest.mark.parametrize("seed", range(3))
def test_random_image_yields_no_attitude(seed: int) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (FIELD.rows, FIELD.columns))
    assert solve(image.astype(np.uint8)).outcome is MeasurementOutcome.NONE


def test_rejects_image_of_another_size() -> None:
    words = r"a picture must have 1024 rows of 1280 pixels, not \(10, 10\)"
    with pytest.raises(ValueError, match=words):
        solve(np.zeros((10, 10), np.uint8))


def test_solving_reports_phases_and_leaves_the_image_unchanged() -> None:
    (_, image), spent = sky(9), meter()
    image.flags.writeable = False
    solve(image, VERIFIED, spent)
    assert {"threshold", "spikes", "centroids", "search", "attitude"} <= set(spent.phases)
    assert 0.02 < spent.table.seconds(spent.total) < 2


# --- the cause of a bad picture, by its traces -------------------------------------------------

Y, X = np.mgrid[: FIELD.rows, : FIELD.columns]


NOISE = np.random.default_rng(0).normal(0, 1.5, Y.shape)


def noisy(level: object) -> NDArray[np.uint8]:
    return np.clip(np.rint(NOISE + level), 0, 255).astype(np.uint8)


def reason(image: NDArray[np.uint8], configuration: Configuration = VERIFIED) -> Reason:
    solution = solve(image, configuration)
    assert solution.outcome is MeasurementOutcome.NONE
    return solution.reason


def hit(count: int) -> NDArray[np.uint8]:
    image = noisy(6.0)
    image.ravel()[np.random.default_rng(1).choice(image.size, count, replace=False)] = 255
    return image


@pytest.mark.parametrize(
    ("image", "expected"),
    [
        (noisy(6.0), Reason.TOO_FEW_STARS),
        (noisy(60.0), Reason.STRAY_LIGHT),
        (noisy(6 + 0.03 * X), Reason.STRAY_LIGHT),
        (noisy(6 + 300.0 * (Y < 300)), Reason.SATURATED),
        (noisy(6 + 300.0 * (np.hypot(X - 640, Y - 500) < 60)), Reason.SATURATED),
        (hit(2000), Reason.TOO_FEW_STARS),
        (hit(60_000), Reason.RADIATION),
    ],
    ids=["dark", "bright", "gradient", "limb", "disc", "few hits", "hits"],
)
def test_failure_reason_matches_the_image(image: NDArray[np.uint8], expected: Reason) -> None:
    assert reason(image) is expected


def test_stars_among_many_hits_are_matched() -> None:
    """Hits beyond the limit of the reason do not keep an attitude from being confirmed."""
    made, image = sky(5)
    places = np.random.default_rng(1).choice(image.size, 60_000, replace=False)
    image.ravel()[places] = 255
    solution = solve(image, VERIFIED)
    assert solution.measured.light is not None
    assert solution.measured.light.spikes > LIMITS.spikes
    assert solution.outcome is MeasurementOutcome.CONCLUSIVE
    assert max(errors_deg(solution.quaternion, made.attitude)) < 0.05


def test_published_profile_does_not_report_radiation() -> None:
    assert reason(hit(2000), PUBLISHED) is Reason.TOO_FEW_STARS
