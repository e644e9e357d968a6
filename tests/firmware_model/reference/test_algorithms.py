"""The C program's algorithms beside the Python program's, profile `published`: equal to the bit."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue
from cubestack.firmware_model.attitude import float_functions, geometry
from cubestack.firmware_model.attitude.geometry import CameraParameters
from cubestack.firmware_model.attitude.quest import AttitudeError, dcm, quest
from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.configuration import (
    camera_parameters,
    detection_config,
    field_cosine,
)
from cubestack.firmware_model.cubestar.detection import (
    Detection,
    DetectionConfig,
    SearchEnd,
    detect_stars,
)
from cubestack.firmware_model.cubestar.matching.identification import Identification, unidentified
from cubestack.firmware_model.cubestar.matching.tracking import track
from cubestack.firmware_model.cubestar.matching.voting import CUT_RADIUS_DEG, identify
from cubestack.firmware_model.cubestar.state import SETTING_COMMANDS
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.node.state import Settings
from cubestack.firmware_model.star_tracker.search import MatchOutcome
from cubestack.host.studies.cubestar.reference_catalogue import catalogue_tables
from tests.tiers import quick

from ..cubestar.sky import Sky, take
from .algorithms import Algorithms, Found, Identified

Floats = NDArray[np.float32]
PUBLISHED = CubeStarSwitches()
METER = Meter(CORTEX_M3)
ENDS = (SearchEnd.COMPLETE, SearchEnd.STARS, SearchEnd.INVALID, SearchEnd.NOISE)
OUTCOMES = (MatchOutcome.IDENTIFIED, MatchOutcome.TOO_FEW_CENTROIDS, MatchOutcome.TOO_FEW_MATCHED)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Algorithms:
    return Algorithms(tmp_path_factory.mktemp("algorithms"))


@pytest.fixture(scope="module")
def listed() -> StarCatalogue:
    return onboard_catalogue(pair_limit_deg=60.0).with_pair_limit(float(PUBLISHED.pair_limit))


@pytest.fixture(scope="module")
def camera() -> CameraParameters:
    return camera_parameters(Settings(INTERFACE, SETTING_COMMANDS))


def bits(values: Any) -> list[Any]:
    """Floats as integers, so that nothing is rounded away."""
    return np.asarray(values, np.float32).view(np.uint32).tolist()  # type: ignore[no-any-return]


def assert_same_detection(found: Found, expected: Detection) -> None:
    count = len(expected.sizes)
    assert found.count == count
    assert bits(found.centroids[: 2 * count]) == bits(expected.centroids.reshape(-1))
    assert found.sizes[:count] == expected.sizes.tolist()
    assert found.intensities[:count] == expected.intensities.tolist()
    assert (found.invalid, found.noise) == (expected.invalid, expected.noise)
    assert found.dark_value == expected.dark_value
    assert ENDS[found.end] is expected.end


def assert_same_identities(found: Identified, expected: Identification) -> None:
    count = len(expected.stars)
    assert found.count == count
    assert found.stars[:count] == expected.stars.tolist()
    assert found.votes[:count] == expected.votes.tolist()
    assert OUTCOMES[found.outcome] is expected.outcome


def solve(
    program: Algorithms, vectors: Floats, expected: Identification, listed: StarCatalogue
) -> None:
    kept = expected.matched
    reference, weights = listed.vectors[expected.stars[kept]], expected.votes[kept].astype("f4")
    found = program.quest(vectors[kept], reference, weights)
    try:
        quaternion = quest(vectors[kept], reference, weights, METER)
    except AttitudeError:
        assert found is None
        return
    assert found is not None
    assert bits(found) == bits(quaternion)
    assert bits(program.dcm(found)) == bits(dcm(quaternion, METER))


def skies(listed: StarCatalogue, count: int, seed: int) -> list[tuple[Sky, NDArray[np.uint8]]]:
    rng = np.random.default_rng(seed)
    shown = []
    for attitude in Rotation.random(count, rng=rng):
        sky = take(listed, attitude)
        noise = rng.poisson(rng.uniform(0, 2.5), sky.picture.shape)
        picture = np.minimum(sky.picture + noise, 255).astype(np.uint8)
        for _ in range(rng.integers(0, 4)):
            y, x = rng.integers(0, 500), rng.integers(0, 1010)
            picture[y : y + rng.integers(2, 12), x : x + rng.integers(2, 12)] = 255
        shown.append((sky, picture))
    return shown


def test_c_processing_returns_the_same_bits_from_centroid_to_attitude(
    program: Algorithms, listed: StarCatalogue, camera: CameraParameters
) -> None:
    settings = Settings(INTERFACE, SETTING_COMMANDS)
    config = detection_config(settings, plain_weights=PUBLISHED.weights == "intensity")
    named = 0
    for _, picture in skies(listed, 10, 1):
        expected = detect_stars(picture, config, METER)
        assert_same_detection(program.detect(picture, config), expected)
        points = geometry.undistort(expected.centroids, camera, METER)
        assert bits(program.undistort(expected.centroids, camera)) == bits(points)
        vectors = geometry.unit_vectors(points, camera, METER)
        assert bits(program.unit_vectors(points, camera)) == bits(vectors)
        identities = identify(vectors, listed, METER)
        assert_same_identities(program.identify(vectors, None, 0.001), identities)
        solve(program, vectors, identities, listed)
        named += identities.outcome is MatchOutcome.IDENTIFIED
    assert named > 6


@pytest.mark.parametrize("seed", quick(range(12), 4))
def test_c_and_python_detection_agree_on_random_blobs(program: Algorithms, seed: int) -> None:
    rng = np.random.default_rng(seed)
    picture = rng.integers(0, rng.integers(6, 40), (512, 1024)).astype(np.uint8)
    picture[picture < rng.integers(4, 40)] = rng.integers(0, 3)
    for _ in range(150):
        y, x = rng.integers(0, 512), rng.integers(0, 1024)
        height, width = rng.integers(1, 14, 2)
        shape = picture[y : y + height, x : x + width].shape
        picture[y : y + height, x : x + width] = rng.choice(
            [rng.integers(0, 256, shape), np.full(shape, 255)]
        )
    first, second = np.sort(rng.integers(1, 101, 2))
    config = DetectionConfig(
        step=int(rng.integers(1, 6)),
        x_start=int(rng.integers(0, 300)),
        y_end=int(rng.integers(300, 513)),
        detection_threshold=int(rng.integers(0, 30)),
        star_threshold=int(rng.integers(0, 30)),
        min_pixels=int(first),
        max_pixels=int(second),
        grid_size=int(rng.choice([1, 3, 5, 7, 15])),
        max_stars=int(rng.integers(1, 21)),
        max_invalid=int(rng.integers(0, 51)),
        max_noise=int(rng.integers(0, 256)),
        plain_weights=True,
    )
    with np.errstate(invalid="ignore"):  # a ring of light has nothing in its middle: 0 / 0
        expected = detect_stars(picture, config, METER)
    assert_same_detection(program.detect(picture, config), expected)


def test_c_and_python_identification_agree_on_random_centroids(
    program: Algorithms, listed: StarCatalogue, camera: CameraParameters
) -> None:
    rng = np.random.default_rng(7)
    outcomes = set()
    for attitude in Rotation.random(120, rng=rng):
        body = attitude.apply(listed.vectors.astype(float))
        seen = body[body[:, 2] > 0.9][: rng.integers(0, 16)]
        false = rng.normal([0, 0, 3], [0.7, 0.4, 0.1], (rng.integers(0, 5), 3))
        vectors = np.concatenate([seen + rng.normal(0, 3e-4, seen.shape), false])
        vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
        vectors = vectors.astype(np.float32)
        margin = float(rng.choice([0.001, 0.0005, 0.003, 0.02]))
        rotation = (Rotation.from_rotvec(rng.normal(0, 0.002, 3)) * attitude).as_matrix()
        rotation = rotation.astype(np.float32)
        near = rotation[2]
        expected = [
            identify(vectors, listed, METER, margin_rad=margin),
            identify(vectors, listed, METER, boresight=near, margin_rad=margin),
            track(vectors, listed, rotation, METER, radius_deg=float(PUBLISHED.reduction)),
        ]
        found = [
            program.identify(vectors, None, margin),
            program.identify(vectors, near, margin),
            program.track(vectors, rotation),
        ]
        intensities = rng.integers(0, 4, len(vectors)).astype(np.uint16)
        for c_result, result in zip(found, expected, strict=True):
            assert_same_identities(c_result, result)
            order = np.lexsort(
                (
                    -intensities[result.matched].astype(int),
                    -result.votes[result.matched].astype(int),
                )
            )
            best = result.matched[order[:3]].tolist()
            assert program.best_stars(c_result, intensities) == best
            shares = [program.confidence(c_result, star) for star in range(len(vectors))]
            assert bits(shares) == bits(result.confidence)
            outcomes.add(result.outcome)
            if result.outcome is MatchOutcome.IDENTIFIED:
                solve(program, vectors, result, listed)
    assert outcomes == set(OUTCOMES)


def test_c_and_python_handle_nan_the_same_way(program: Algorithms, listed: StarCatalogue) -> None:
    vectors = np.array([[np.nan] * 3, [0, 0, 1], [0.1, 0, 0.995]], np.float32)
    expected = identify(vectors, listed, METER)
    assert_same_identities(program.identify(vectors, None, 0.001), expected)
    for nothing in (0, 1):
        found = program.track(vectors[:nothing], np.eye(3, dtype=np.float32))
        assert_same_identities(found, unidentified(nothing, MatchOutcome.TOO_FEW_CENTROIDS))


def test_c_and_python_quest_refuse_the_same_inputs(program: Algorithms) -> None:
    axis = np.array([[0, 0, 1]], np.float32)
    for measured, weights in (
        (np.repeat(axis, 3, 0), [1, 1, 1]),
        (axis, [1]),
        (np.eye(3, dtype=np.float32), [0, 0, 0]),
    ):
        with pytest.raises(AttitudeError):
            quest(measured, measured, np.array(weights, np.float32), METER)
        assert program.quest(measured, measured, np.array(weights, np.float32)) is None


def test_c_quest_returns_the_same_bits_as_python(program: Algorithms) -> None:
    rng = np.random.default_rng(3)
    turns = [*Rotation.random(300, rng=rng), *Rotation.from_rotvec(np.pi * np.eye(3))]
    for turn in turns:
        reference = rng.normal(size=(int(rng.integers(2, 21)), 3))
        reference /= np.linalg.norm(reference, axis=1, keepdims=True)
        measured = turn.apply(reference).astype(np.float32)
        weights = rng.integers(0, 20, len(reference)).astype(np.float32)
        weights[:2] += 1
        expected = quest(measured, reference.astype(np.float32), weights, METER)
        found = program.quest(measured, reference.astype(np.float32), weights)
        assert found is not None
        assert bits(found) == bits(expected)


def test_c_functions_and_directions_return_the_same_bits(program: Algorithms) -> None:
    rng = np.random.default_rng(11)
    for x in np.concatenate([rng.uniform(-1, 1, 2000), [1, -1, 0, 0.5, -0.5]]).astype("f4"):
        assert bits(program.call("arc_cosine", x)) == bits(float_functions.arc_cosine(x))
    for y, x in [*rng.normal(size=(2000, 2)).astype("f4"), *np.eye(2, dtype="f4"), (0, 0)]:
        tangent = float_functions.arc_tangent(np.float32(y), np.float32(x))
        assert bits(program.call("arc_tangent", y, x)) == bits(tangent)
    for ra, dec in rng.uniform([-3.2, -1.6], [6.3, 1.6], (1000, 2)):
        direction = geometry.direction_of(ra, dec, METER)
        assert bits(program.direction_of(ra, dec)) == bits(direction)
        assert bits(program.angles_of(direction)) == bits(geometry.angles_of(direction, METER))


def test_c_and_python_count_the_same_stars_near_a_direction(
    program: Algorithms, listed: StarCatalogue, camera: CameraParameters
) -> None:
    edge = field_cosine(camera)
    assert bits(program.field_cosine(camera)) == bits(edge)
    for pose in Rotation.random(50, rng=np.random.default_rng(2)):
        boresight = pose.as_matrix()[2].astype(np.float32)
        assert program.count_near(boresight, edge) == len(listed.within(boresight, edge, METER))


def test_reduced_list_fits_every_direction(program: Algorithms, listed: StarCatalogue) -> None:
    """Of random directions, other than those that the generator counted."""
    vectors = np.random.default_rng(4).normal(size=(300, 3))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    longest = max(
        len(listed.reduced(v.astype(np.float32), CUT_RADIUS_DEG, METER)[1]) for v in vectors
    )
    header = catalogue_tables()["catalogue_tables.h"]
    room = int(header.split("REDUCED_PAIRS ")[1].split()[0])
    assert longest <= room < 1.2 * longest
