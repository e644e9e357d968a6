import json

import pytest

from tests.conftest import Run


def ball(run: Run, *options: str) -> list[dict[str, float]]:
    code, out, err = run("ball", "--step", "30", "--samples", "2", "--json", *options)
    assert (code, err) == (0, "")
    return [json.loads(line) for line in out.splitlines()]


def test_directions_and_profiles(run: Run) -> None:
    published = ball(run, "--profile", "published")
    mean = sum(line["offset_deg"] for line in published) / 4
    assert 0.04 < mean < 0.4  # published: 0.12 to 0.16
    assert [line["direction"] for line in published] == ["right", "left", "down", "up"]
    assert all(line["detected"] == line["pictures"] == 4 for line in published)
    # 10 mm before the axis: 0.88 deg more at 30 deg, none at 0.
    off = ball(run, "--profile", "extended", "--off-axis", "10")
    assert all(line["offset_deg"] == pytest.approx(0.44, abs=0.04) for line in off)
    assert all(line["sigma_deg"] < 0.05 for line in off)
