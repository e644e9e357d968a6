from itertools import cycle
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.scene.attitude import matrix_from_quaternion, quaternion_from_pointing
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.host.experiments.aramis.measure import _count_wrong
from cubestack.host.experiments.cubestar.measure import count_wrong

TRUTH = quaternion_from_pointing(84.0, -1.0, 20.0)
BELT = (25930, 26311, 26727)


def seen(hipparcos: int, off_deg: float = 0.0) -> np.ndarray:
    """Direction of a star in camera axes, moved to the right."""
    sky = load_sky()
    vector = matrix_from_quaternion(TRUTH) @ sky.vectors[np.searchsorted(sky.hip, hipparcos)]
    return np.asarray(vector + np.tan(np.radians(off_deg)) * np.array([1.0, 0.0, 0.0]))


def cubestar(*off_deg: float, unnamed: int = 1) -> Any:
    """A CubeStar that found the belt, each star off by an angle, and unnamed stars."""
    stars = [SimpleNamespace(number=n, hipparcos=one) for n, one in enumerate(BELT)]
    stars += [SimpleNamespace(number=3 + n, hipparcos=None) for n in range(unnamed)]
    vectors = [seen(one, off) for one, off in zip(BELT, off_deg, strict=True)]
    vectors += [np.array([0.0, 0.0, 1.0])] * unnamed
    records = cycle(
        {"StarNumber": n, **dict(zip(("VbX", "VbY", "VbZ"), vector, strict=True))}
        for n, vector in enumerate(vectors)
    )
    summary = {"NumStarsDetected": len(stars)}
    client = SimpleNamespace(
        telemetry=lambda name: summary if name == "DetectionSummary" else next(records)
    )
    return SimpleNamespace(client=client, stars=lambda: stars)


@pytest.mark.parametrize(
    ("off_deg", "wrong"),
    [((0.0, 0.0, 0.0), 0), ((0.19, 0.0, 0.0), 0), ((0.22, 0.0, 0.0), 1), ((5.0, 0.1, 3.0), 2)],
)
def test_stars_more_than_0_2_deg_away_are_wrong(off_deg: tuple[float, ...], wrong: int) -> None:
    assert count_wrong(cubestar(*off_deg), TRUTH) == wrong


def test_without_truth_wrong_stars_are_unknown() -> None:
    assert count_wrong(cubestar(0.0, 0.0, 9.0), None) is None
    emulated: Any = SimpleNamespace(board=SimpleNamespace(camera=SimpleNamespace(scene=object())))
    assert _count_wrong(emulated, [], None) is None
    assert _count_wrong(emulated, [], TRUTH) is None  # not of a sky
