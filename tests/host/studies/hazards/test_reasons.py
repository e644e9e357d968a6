"""A refusal names the hazard in front of the camera, or what the search lacked; never another."""

import pytest

from cubestack.host.experiments.hazard_options import known
from cubestack.host.studies.hazards.curves import Job, Point, hazards_of, registered
from cubestack.host.studies.hazards.curves import run as run_jobs

LIGHT = {"saturated", "stray_light"}
NAMED = {
    "background": {"stray_light"},
    "dose": {"radiation"},
    "earth-limb": LIGHT,
    "ghosts": {"saturated"},
    "glint": LIGHT,
    "gradient": {"stray_light"},
    "hot-pixels": {"radiation"},
    "moon": LIGHT,
    "protons": {"radiation"},
    "sky-glow": LIGHT,
    "sun-glare": LIGHT,
}
"""Disturbances that each hazard is; the others are none."""

OPEN = {"unconfirmed", "no_triangle", "no_time", "too_few_stars", "ambiguous", "lens"}
"""Reasons of a search that no disturbance explains."""

FRAMES = 2


def points(name: str, *, harsh: bool) -> list[Point]:
    """Hazards of a star tracker at their median or their worst strength."""
    jobs = []
    for hazard in hazards_of(registered(name)):
        strengths = known()[hazard].strength.values
        strength = strengths[-1 if harsh else len(strengths) // 2]
        jobs.append(Job(name, "extended", hazard, strength, FRAMES, 77))
    return list(run_jobs(jobs, 1))


def reasons(point: Point) -> set[str]:
    return {reason.replace(" ", "_") for reason in point.reasons}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["aramis", "cubestar"])
def test_worst_hazards_are_the_reasons_of_their_refusals(name: str) -> None:
    found = points(name, harsh=True)
    for point in found:
        assert reasons(point) <= NAMED.get(point.hazard, set()) | OPEN, point
    assert any(reasons(point) & LIGHT for point in found)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["aramis", "cubestar"])
def test_mild_hazards_are_no_reasons(name: str) -> None:
    """Their skies have many stars, and are solved."""
    for point in points(name, harsh=False):
        if point.hazard != "ghosts":  # which no strength leaves mild
            assert not reasons(point) - OPEN, point
