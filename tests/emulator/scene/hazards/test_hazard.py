from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.hazards.hazard import Hazard, Strength, key


@dataclass(frozen=True, kw_only=True)
class Fog(Hazard):
    """A hazard with a key of each kind."""

    name: ClassVar[str] = "fog"
    meaning: ClassVar[str] = "water in the air"
    strength: ClassVar[Strength] = Strength("banks", "", (0, 3))

    banks: int = key(1, "number of banks", 0, 9)
    depth_m: float | None = key(None, "depth of each, m", 0, 50)
    kind: str = "sea"


@pytest.mark.parametrize(
    ("values", "refused"),
    [
        ({"banks": 10}, "banks of the hazard fog must be in 0..9, not 10"),
        ({"depth_m": -1.0}, "depth_m of the hazard fog must be in 0..50, not -1"),
        ({"depth_m": float("nan")}, "depth_m of the hazard fog must be in 0..50, not nan"),
        ({"seed": -1}, "seed of the hazard fog must be in 0.."),
        ({"seed": 2**63}, "seed of the hazard fog must be in 0.."),  # more than TOML has
    ],
)
def test_what_is_out_of_range_is_refused(values: dict[str, float], refused: str) -> None:
    with pytest.raises(SceneError, match=refused):
        Fog(**values)
    assert Fog(banks=9, depth_m=50.0).depth_m == 50


def test_one_of_a_strength_has_a_seed_of_its_own_that_repeats() -> None:
    first, again = (Fog.placed(3.0, None, np.random.default_rng(5)) for _ in range(2))
    assert first == again
    assert first.banks == 3
    assert isinstance(first.banks, int)
    assert first.seed != Fog.placed(3.0, None, np.random.default_rng(6)).seed
