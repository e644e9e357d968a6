"""Telemetry of single stars, against the sky that was drawn."""

from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.interface.cubestar import INTERFACE, IdMode

from .harness import Harness
from .sky import Sky, take, undistort

STEPPING = [message.name for message in INTERFACE.telemetries if message.steps]
OF_IDENTIFIED_STARS = ("IDStarsDetails", "InertialUnitVectors", "HipparcosNumber")
VECTOR_STEP = 1e-4


@pytest.fixture
def solved(unit: Harness, sky: Sky) -> Harness:
    """A unit that has identified the sky, in which one spot is no star."""
    unit.picture = sky.picture.copy()
    unit.picture[480:484, 30:34] = 70
    unit.command("CaptureAndProcess", "SelectBestStars")
    return unit


def records(unit: Harness, frame: str, count: int) -> dict[int, dict[str, float]]:
    read = [unit.telemetry(frame) for _ in range(count)]
    return {int(values["StarNumber"]): values for values in read}


def pick(values: dict[str, float], *names: str) -> list[float]:
    return [values[name] for name in names]


def near(expected: Any, within: float) -> Any:
    return pytest.approx(expected, abs=within)


def truth(unit: Harness, sky: Sky) -> dict[int, int]:
    """Number of each detected star that is in the sky -> its index there."""
    found = {}
    for number, values in records(unit, "StarPositions", len(sky.stars) + 1).items():
        place = pick(values, "X_Coordinate", "Y_Coordinate")
        distance = np.linalg.norm(sky.pixels - place, axis=1)
        if distance.min() < 1:
            found[number] = int(distance.argmin())
    assert len(found) == len(sky.stars)
    return found


@pytest.mark.parametrize("frame", STEPPING)
def test_each_read_gives_the_next_star_and_wraps(solved: Harness, sky: Sky, frame: str) -> None:
    stars = len(sky.stars) + (frame not in OF_IDENTIFIED_STARS)
    numbers = [solved.telemetry(frame)["StarNumber"] for _ in range(2 * stars + 1)]
    assert len(set(numbers[:stars])) == stars
    assert numbers[:stars] == sorted(numbers[:stars])
    assert numbers == numbers[:stars] * 2 + numbers[:1]


@pytest.mark.parametrize("frame", STEPPING)
def test_stepping_telemetry_frames_have_independent_positions(solved: Harness, frame: str) -> None:
    first = solved.telemetry(frame)
    for other in STEPPING:
        if other != frame:
            solved.telemetry(other)
    second = solved.telemetry(frame)
    assert second["StarNumber"] > first["StarNumber"]


@pytest.mark.parametrize("frame", STEPPING)
def test_new_results_restart_stepping_telemetry(solved: Harness, frame: str) -> None:
    first = solved.telemetry(frame)
    solved.telemetry(frame)
    solved.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE)  # as before
    solved.command("ProcessImage")
    assert solved.telemetry(frame) == first


@pytest.mark.parametrize("frame", STEPPING)
def test_star_telemetry_without_stars_is_empty(unit: Harness, frame: str) -> None:
    values = unit.telemetry(frame)
    assert values["StarNumber"] == 255
    identity = next((values[name] for name in ("Identity", "ID") if name in values), 65535)
    assert identity == 65535
    others = values.keys() - {"StarNumber", "Identity", "ID"}
    assert not any(values[name] for name in others)


@pytest.mark.parametrize("frame", [frame for frame in STEPPING if frame in OF_IDENTIFIED_STARS])
def test_failed_identification_reports_no_identified_stars(solved: Harness, frame: str) -> None:
    solved.command("setIDMargin", Margin=0.0001)
    solved.command("setFocalLength", FocalLength=7.0)
    solved.command("ProcessImage")
    assert solved.telemetry(frame)["StarNumber"] == 255
    assert solved.telemetry("NumIdStars")["numIdStars"] == 0


def test_star_telemetry_shows_positions_vectors_and_details(solved: Harness, sky: Sky) -> None:
    stars = truth(solved, sky)
    ideal = undistort(sky.pixels)
    body = sky.attitude.apply(solved.catalogue.vectors[sky.stars].astype(float))
    positions, vectors, details = (
        records(solved, frame, len(stars) + 1)
        for frame in ("StarPositions", "BodyUnitVectors", "StarDetails")
    )
    for number, star in stars.items():
        place, detail = positions[number], details[number]
        assert pick(place, "X_Coordinate", "Y_Coordinate") == near(sky.pixels[star], 0.05)
        corrected = pick(place, "X_CorrectedCoordinate", "Y_CorrectedCoordinate")
        assert corrected == near(ideal[star], 0.06)
        assert pick(vectors[number], "VbX", "VbY", "VbZ") == near(body[star], VECTOR_STEP)
        assert pick(detail, "Vbx", "Vby", "Vbz") == near(1e4 * body[star], 1)
        assert pick(detail, "CCx", "CCy") == near(ideal[star], 0.06)
        assert pick(detail, "ID", "ValidationVote") == [sky.stars[star], len(stars) - 1]
        assert detail["confidance"] == near((len(stars) - 1) / len(stars), 1e-6)
    (spot,) = positions.keys() - stars.keys()
    fields = ("X_Coordinate", "Y_Coordinate", "Size", "Intensity")
    assert pick(positions[spot], *fields) == [31.5, 481.5, 16, 16 * 70]
    assert pick(details[spot], "ID", "ValidationVote", "confidance") == [65535, 0, 0]


def test_identified_star_telemetry_shows_names_and_votes(solved: Harness, sky: Sky) -> None:
    stars = truth(solved, sky)
    assert solved.telemetry("NumIdStars")["numIdStars"] == len(stars)
    details = records(solved, "IDStarsDetails", len(stars))
    inertial = records(solved, "InertialUnitVectors", len(stars))
    names = records(solved, "HipparcosNumber", len(stars))
    assert details.keys() == inertial.keys() == names.keys() == stars.keys()
    for number, star in stars.items():
        identity = int(sky.stars[star])
        votes = len(stars) - 1  # of each other star; the false one confirms none
        confidence = 100 * votes / len(stars)
        assert details[number]["Identity"] == inertial[number]["Identity"] == identity
        assert details[number]["ValidationVotes"] == votes
        assert details[number]["Confidence"] == near(confidence, 0.5)
        assert inertial[number]["Confidence"] == near(confidence, 0.5)
        vector = pick(inertial[number], "ViX", "ViY", "ViZ")
        assert vector == near(solved.catalogue.vectors[identity], VECTOR_STEP)
        assert names[number]["Hipparcos"] == solved.catalogue.hip[identity]
        assert pick(names[number], "X", "Y") == near(sky.pixels[star], 0.05)


def test_match_summary_reports_counts_votes_and_confidence(solved: Harness, sky: Sky) -> None:
    count = len(sky.stars)
    values = solved.telemetry("MatchSummary")
    assert (values["Detected"], values["Matched"]) == (count + 1, count)
    assert values["MaxVotes"] == count - 1
    assert values["MeanConfidence"] == pytest.approx((count - 1) / count, abs=1e-6)
    fresh = Harness(solved.catalogue).telemetry("MatchSummary")
    assert not any(fresh.values())


def test_best_stars_are_the_brightest_with_the_most_votes(solved: Harness, sky: Sky) -> None:
    stars = truth(solved, sky)
    positions = records(solved, "StarPositions", len(stars) + 1)
    bodies = records(solved, "BodyUnitVectors", len(stars) + 1)
    by_light = sorted(stars, key=lambda number: -positions[number]["Intensity"])
    chosen = solved.telemetry("BestStarIndex")
    assert pick(chosen, "Star1Index", "Star2Index", "Star3Index") == by_light[:3]
    for n, number in enumerate(by_light[:3], 1):
        identity = int(sky.stars[stars[number]])
        values = solved.telemetry(f"Star{n}Details")
        place = pick(positions[number], "X_Coordinate", "Y_Coordinate")
        assert pick(values, f"S{n}CentX", f"S{n}CentY") == near(place, 0.5)
        assert values[f"S{n}Mag"] == positions[number]["Intensity"]
        body = pick(bodies[number], "VbX", "VbY", "VbZ")
        assert [values[f"S{n}VB{axis}"] for axis in "XYZ"] == body
        inertial = [values[f"S{n}VI{axis}"] for axis in "XYZ"]
        assert inertial == near(solved.catalogue.vectors[identity], VECTOR_STEP)
        confidence = round(100 * (len(stars) - 1) / len(stars))
        assert pick(values, f"S{n}CatNum", f"S{n}Conf") == [identity, confidence]


def test_best_stars_can_be_fewer_than_three(lit: Harness, sky: Sky) -> None:
    lit.command("CaptureAndProcess")
    lit.command("setIDMode", IdMode=0)  # tracking needs two stars
    lit.picture = take(lit.catalogue, sky.attitude, most=2).picture
    lit.command("CaptureAndProcess", "SelectBestStars")
    chosen = lit.telemetry("BestStarIndex")
    assert sorted([chosen["Star1Index"], chosen["Star2Index"]]) == [0, 1]
    assert chosen["Star3Index"] == 255
    values = lit.telemetry("Star3Details")
    assert values.pop("S3CatNum") == 65535
    assert not any(values.values())
