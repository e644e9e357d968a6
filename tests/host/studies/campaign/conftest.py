"""A fake device whose seed determines its results."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.host.devices.experiment import Result
from cubestack.host.studies.campaign import block
from cubestack.host.studies.campaign.folder import Folder
from cubestack.host.studies.campaign.plan import CampaignPlan


@dataclass(frozen=True)
class Seen(Result):
    """The number that a frame drew; small ones are refused."""

    drawn: float
    false_stars: int
    wall_ms: float
    reason: str = "dark"
    ending: str = ""

    @property
    def solved(self) -> bool:
        return self.drawn > 0.2

    @property
    def right(self) -> bool:
        return self.drawn > 0.3


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> set[float]:
    """Results in place of cubestar's; those drawn above a value in the set fail."""
    above = set[float]()

    def measure(_device: str, *, frames: int, seed: int, **options: Any) -> Iterator[Seen]:
        generator = np.random.default_rng(seed)
        for _ in range(frames):
            drawn = float(generator.random())
            if any(drawn > limit for limit in above):
                raise IndexError(f"drawn {drawn:.3f}")
            yield Seen(
                drawn, options.get("false_stars", 0), float(np.random.default_rng().random())
            )

    monkeypatch.setattr(block, "measure", measure)
    return above


@pytest.fixture
def plan() -> CampaignPlan:
    """Two points of seven frames, in blocks of three."""
    return CampaignPlan(device="cubestar", frames=7, seed=5, block=3, grid={"false_stars": [0, 9]})


@pytest.fixture
def folder(tmp_path: Path, plan: CampaignPlan) -> Folder:
    """An empty folder with that plan."""
    return Folder.begun(tmp_path / "c", plan, resume=False)
