from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.host.studies.lens_errors import (
    RECORD,
    SIGMAS,
    LensCount,
    by_strength,
    count,
    counted,
    rows,
)

DOCS = Path(__file__).parents[3] / "docs"


def result(**values: Any) -> Any:
    usual = {"solved": True, "right": True, "reason": "solved", "ending": ""}
    return SimpleNamespace(
        **(usual | {"sigma_deg": [0.1, 0.2, 0.3], "error_deg": [0, 0, 0]} | values)
    )


def test_counts_each_sky_once_and_claims_of_believed_attitudes() -> None:
    far = [0.0, 0.0, -0.31 * SIGMAS]
    refused = {"solved": False, "right": False, "sigma_deg": None}
    found = counted(
        [
            result(),
            result(right=False, error_deg=[0.3, 0.0, 0.0]),
            result(right=False, error_deg=far),
            result(**refused, reason="lens", error_deg=far),
            result(**refused, reason="no time", error_deg=None),
        ]
    )
    assert found == LensCount(5, 1, 1, 1, 2, 1, pytest.approx(0.2))


def test_page_shows_the_recorded_rows_and_no_other() -> None:
    recorded = rows((DOCS / "data" / RECORD).read_text("utf-8"))
    page = (DOCS / "identification.md").read_text("utf-8")
    _, table = page.split("| refused | no match | off | outside | claim |\n", 1)
    assert table.split("\n\n")[0].splitlines()[1:] == [one.line for one in recorded]
    for one in recorded:
        number = one.count
        assert number.skies == 250 * len(one.seeds)
        assert number.right + number.refused + number.unmatched + number.off == number.skies


def test_each_strength_is_counted_on_the_same_skies() -> None:
    found = by_strength(None, 3, device="cubestar", hazard="pixel-aspect", strengths=(0.0, 5.0))
    assert found["0 right"] == 100
    assert found["5 right"] == 0
    assert found["5 unmatched"] + found["5 refused"] + found["5 off"] == 3


def test_no_recorded_wrong_lens_was_believed_outside_of_the_claim() -> None:
    for one in rows((DOCS / "data" / RECORD).read_text("utf-8")):
        assert one.hazard is None or one.count.outside == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("device", "hazard", "strength"),
    [
        ("cubestar", "pixel-aspect", 2.0),
        ("cubestar", "wobble", 3.0),
        ("aramis", "principal-point", 10.0),
        ("aramis", "pixel-skew", 0.5),
    ],
)
def test_no_wrong_lens_is_believed_outside_of_the_claim(
    device: str, hazard: str, strength: float
) -> None:
    found = count(device, hazard, strength, skies=60, seed=2000)
    assert found.skies == 60
    assert found.outside == 0
    assert found.right + found.off > 15


@pytest.mark.slow
@pytest.mark.parametrize("device", ["cubestar", "aramis"])
def test_half_a_percent_of_aspect_is_right(device: str) -> None:
    assert count(device, "pixel-aspect", 0.5, skies=60, seed=2000).right >= 54
