"""The page of hazards: each one has its section, pictures, curve and numbers."""

import json
import re
from pathlib import Path

import pytest

from cubestack.host.devices.registry import device
from cubestack.host.experiments.hazard_options import known
from cubestack.host.studies.hazards.album import PAGE, PICTURES
from cubestack.host.studies.hazards.curves import devices_with_hazards, hazards_of

DOCS = Path(__file__).parents[4] / "docs"


@pytest.mark.parametrize("name", sorted(known()))
def test_page_shows_each_hazard_for_each_device(name: str) -> None:
    page = (DOCS / PAGE).read_text("utf-8")
    (section,) = re.findall(rf"^## {name}\n(.*?)(?=^## |^<!--)", page, re.DOTALL | re.MULTILINE)
    shown = [part.name for part in (DOCS / PICTURES).glob(f"{name}-*")]
    takers = [taker for taker in devices_with_hazards() if name in hazards_of(device(taker))]
    assert sorted(re.findall(r"hazards/([\w.-]+)\)", section)) == sorted(
        [f"{name}-curve.png", *(f"{name}-{taker}.jpg" for taker in takers)]
    )
    assert set(re.findall(r"hazards/([\w.-]+)\)", section)) <= set(shown)


def test_page_numbers_match_the_points() -> None:
    page = (DOCS / PAGE).read_text("utf-8")
    lines = (DOCS / PICTURES / "points.jsonl").read_text("utf-8").splitlines()
    points = [json.loads(line) for line in lines]
    assert {point["hazard"] for point in points} == set(known())
    for point in points:
        pictures = point["right"] + point["refused"] + point["wrong"]
        row = (
            f"| {device(point['device']).title} | {point['strength']:g} "
            f"| {point['right']} of {pictures} | {point['refused']}"
        )
        assert row in page
