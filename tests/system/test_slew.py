import pytest

from cubestack.firmware_model.interface.codec.switches import PROFILES
from cubestack.host.devices.registry import device
from cubestack.host.experiments.opener import Opener
from cubestack.host.studies.cubestar.shots import PICTURES, Shot, slewing_shots


def _turning(profile: str, frames: int, rate_deg_s: float) -> list[Shot]:
    opened = Opener(device("cubestar"), board={"profile": profile})
    return list(slewing_shots(opened, frames, rate_deg_s))


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("rate", [0.0635, 0.1333])
def test_slow_turns_are_tracked_by_every_star(profile: str, rate: float) -> None:
    taken = _turning(profile, PICTURES, rate)
    assert all(shot.right and shot.matched >= shot.detected - 1 for shot in taken)
    assert [shot.tracked for shot in taken] == [False] + [True] * (PICTURES - 1)


@pytest.mark.parametrize(("profile", "rate"), [("published", 2), ("published", 8), ("extended", 8)])
def test_streaks_are_not_tracked(profile: str, rate: float) -> None:
    taken = _turning(profile, 6, rate)
    assert not any(shot.tracked for shot in taken)
    assert sum(shot.right for shot in taken) <= (2 if rate < 8 else 0)
