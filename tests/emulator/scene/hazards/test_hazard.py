from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cubestack.emulator.scene.hazards.hazard import Hazard, Strength
from cubestack.firmware_model.values import number, whole


@dataclass(frozen=True, kw_only=True)
class Fog(Hazard):
    name: ClassVar[str] = "fog"
    meaning: ClassVar[str] = "water in the air"
    strength: ClassVar[Strength] = Strength("banks", "", (0, 3))

    banks: int = whole(1, "number of banks", 0, 9)
    depth_m: float | None = number(None, "depth of each", 0, 50)
    kind: str = "sea"


def test_one_of_a_strength_has_a_seed_of_its_own_that_repeats() -> None:
    first, again = (Fog.sample(3.0, None, np.random.default_rng(5)) for _ in range(2))
    assert first == again
    assert first.banks == 3
    assert isinstance(first.banks, int)
    assert first.seed != Fog.sample(3.0, None, np.random.default_rng(6)).seed
