from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.aramis.catalogue.hamming import decode, encode
from cubestack.firmware_model.aramis.detection.mask import LevelHistory, SpikeRemoval
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.matching.shutter import at_middle_row
from cubestack.firmware_model.aramis.pipeline import PUBLISHED, VERIFIED, Configuration
from cubestack.firmware_model.aramis.pipeline import solve as solve_picture
from cubestack.firmware_model.aramis.solution import Solution
from cubestack.host.studies.aramis.sky import FIELD, Light, database, meter, picture
from tests.together import together

from ..operations import as_on_record
from .test_pipeline import sky

PICTURES = {
    "published": PUBLISHED,
    "verified": VERIFIED,
    "windows kept whole": replace(
        PUBLISHED, detection=replace(PUBLISHED.detection, spikes=SpikeRemoval.WINDOW, needed=4)
    ),
    "no spikes removed": replace(
        PUBLISHED, detection=replace(PUBLISHED.detection, spikes=SpikeRemoval.OFF, sigmas=8)
    ),
}
LISTS = {
    "faint": Light(),
    "few": Light(mag_limit=4.5, most=5),
    "false": Light(false_stars=8, false_mags=(1, 3)),
    "coarse": Light(noise_px=1.0),
}
PROFILES = {
    "published": PUBLISHED.profile,
    "always a pivot": replace(PUBLISHED.profile, always_pivot=True),
    "unfiltered": replace(PUBLISHED.profile, filtered=False),
    "names of section 5.8": replace(PUBLISHED.profile, identities="section-5.8"),
    "names of appendix E": replace(PUBLISHED.profile, identities="appendix-e"),
    "verified": VERIFIED.profile,
}


def numbers(found: Solution) -> list[float]:
    """Outcome and counts only, because an attitude's last digits depend on the processor."""
    ends = [found.outcome.value, found.reason.value]
    counts = [found.candidates, found.pivots, found.triples, found.expected, len(found.measured)]
    return [*ends, *counts, *found.stars[:30].tolist()]


@pytest.mark.parametrize("name", PICTURES)
def test_image_processing_charges_the_recorded_operations(name: str) -> None:
    spent = meter()
    configuration: Configuration = PICTURES[name]
    found = solve_picture(sky(9)[1], LevelHistory(), configuration, database(), spent)
    as_on_record(f"AraMiS picture: {name}", spent, numbers(found))


@together("profile", PROFILES)
@together("light", LISTS)
@together("hint_deg", [None, 2.0])
def test_matching_of_star_lists_charges_the_recorded_operations(
    light: str, profile: str, hint_deg: float | None
) -> None:
    rng, spent = np.random.default_rng(5), meter()
    made = picture(rng, FIELD, LISTS[light])
    hint = None if hint_deg is None else made.hint(hint_deg, rng)
    found = identify(made.stars, FIELD, PROFILES[profile], database(), spent, hint)
    as_on_record(f"AraMiS list: {light}, {profile}, hint {hint_deg}", spent, numbers(found))


@pytest.mark.parametrize("round_", [False, True])
def test_camera_field_charges_the_recorded_operations(round_: bool) -> None:
    spent, field = meter(), CameraField(round=round_)
    points = np.linspace((0, 0), (1279, 1023), 40, dtype=np.float32)
    directions = field.directions(points, spent)
    inside = field.inside(points, spent), field.contains(directions, spent)
    as_on_record(f"AraMiS field: round {round_}", spent, [int(each.sum()) for each in inside])


def test_rolling_shutter_correction_charges_the_recorded_operations() -> None:
    rng, spent = np.random.default_rng(6), meter()
    made: Any = picture(rng, FIELD)
    vectors = FIELD.directions(made.stars.centroids, meter())
    heights = rng.uniform(-0.5, 0.5, len(vectors)).astype(np.float32)
    at_middle_row(vectors, vectors, heights, 1e-3, spent)
    as_on_record("AraMiS shutter", spent)


def test_flash_decoding_charges_the_recorded_operations() -> None:
    spent, coded = meter(), encode(bytes(range(80)))
    coded[[0, 20, 40]] ^= 1
    coded[[60, 61]] ^= 1
    found = decode(coded, spent)
    as_on_record("AraMiS flash", spent, [found.corrected, len(found.lost)])
