from collections.abc import Mapping
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.host.clients.cubestar.operator import LADDER, find_threshold
from cubestack.host.studies.cubestar.night import choose_threshold


class Sky:
    """A CubeStar with fixed results for each threshold.

    Attributes:
        seen: (centroids, matched, most votes) by threshold; others give no attitude.
        tried: thresholds that a picture was processed with.
    """

    def __init__(self, seen: Mapping[int, tuple[int, int, int]], full: int = 0) -> None:
        self.seen, self.full = seen, full
        self.tried = list[int]()
        self.captured = 0
        self.thresholds = (7, 9)
        self.modes = list[object]()
        self.client = self

    def telemetry(self, name: str) -> dict[str, int]:
        found = self.seen.get(self.thresholds[0], (self.full, 0, 0))
        return {
            "DetectionThresholdValues": dict(
                zip(("DetectionThreshold", "StarThreshold"), self.thresholds, strict=True)
            ),
            "MatchSummary": {"MaxVotes": found[2]},
            "DetectionSummary": {"NumStarsDetected": found[0]},
        }[name]

    def command(self, name: str, **values: Any) -> None:
        if name == "setDetectionThresholds":
            self.thresholds = (values["DetectionThreshold"], values["StarThreshold"])
        else:
            self.modes.append(values["IdMode"])

    def configure(self, settings: Mapping[str, Mapping[str, int]]) -> None:
        for name, values in settings.items():
            self.command(name, **values)

    def capture(self) -> None:
        self.captured += 1

    def process_image(self) -> None:
        self.tried.append(self.thresholds[0])

    def attitude(self) -> SimpleNamespace:
        found = self.seen.get(self.thresholds[0])
        return SimpleNamespace(valid=found is not None, matched=found[1] if found else 99)


def test_thresholds_rise_by_about_a_quarter_up_to_255() -> None:
    assert LADDER[0] == 1
    assert 150 < LADDER[-1] <= 255
    for low, high in pairwise(LADDER):
        assert high - low == 1 or 1.2 <= high / low <= 1.34


def test_sets_the_threshold_that_confirms_most_stars() -> None:
    sky: Any = Sky({6: (12, 9, 4), 10: (9, 8, 9), 20: (5, 5, 7), 40: (3, 3, 1)})
    assert find_threshold(sky) == 10
    assert sky.thresholds == (10, 10)
    assert sky.tried == list(LADDER)
    assert sky.captured == 1
    assert len(sky.modes) == len(LADDER)


def test_tie_goes_to_the_threshold_with_more_votes() -> None:
    # Of n stars, each has at most n - 1 others that vote for it.
    sky: Any = Sky({6: (9, 5, 4), 25: (9, 5, 9), 32: (9, 6, 3)})
    assert find_threshold(sky) == 25
    sky = Sky({6: (9, 5, 4), 25: (9, 5, 3)})
    assert find_threshold(sky) == 6


def test_matches_of_several_views_are_added() -> None:
    skies = [{6: (9, 6, 9)}, {10: (9, 5, 9)}, {10: (9, 4, 9)}]
    sky: Any = Sky({})

    def views() -> Any:
        for seen in skies:
            sky.seen = seen
            yield

    assert find_threshold(sky, views()) == 10
    assert sky.captured == 3


def test_without_an_attitude_the_threshold_does_not_change() -> None:
    sky: Any = Sky({})
    assert find_threshold(sky) is None
    assert sky.thresholds == (7, 9)


def test_night_threshold_finds_few_stars_mostly_matched() -> None:
    sky: Any = Sky(
        {50: (5, 5, 0), 40: (9, 8, 0), 32: (14, 10, 0), 25: (16, 12, 0), 20: (17, 17, 0)}
    )
    assert choose_threshold(sky) == 25
    assert sky.thresholds == (25, 25)
    assert sky.tried == [one for one in reversed(LADDER) if one >= 20]
    assert sky.captured == 1


@pytest.mark.parametrize(("more", "chosen"), [((10, 8), 40), ((10, 9), 32), ((9, 8), 32)])
def test_night_threshold_penalises_unmatched_stars(more: tuple[int, int], chosen: int) -> None:
    sky: Any = Sky({40: (6, 6, 0), 32: (*more, 0), 25: (99, 50, 0)})
    assert choose_threshold(sky) == chosen


def test_night_threshold_without_matches_is_the_highest() -> None:
    sky: Any = Sky({}, full=4)
    assert choose_threshold(sky) == LADDER[-1]
    assert sky.thresholds == (LADDER[-1],) * 2
