"""Figures of the fidelity page, computed in another way."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.fisheye import DISTORTION
from cubestack.host.studies.cubesense.fidelity import _lens


def test_discriminant_matches_the_roots_of_the_polynomial() -> None:
    nothing: Any = None
    differences = [one - other for one, other in combinations(np.roots(DISTORTION), 2)]
    expected = DISTORTION[0] ** 4 * np.prod(differences) ** 2
    assert _lens(nothing, 0)["discriminant"] == pytest.approx(expected.real, rel=1e-10, abs=0)
