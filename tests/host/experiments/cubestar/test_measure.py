import json
from itertools import cycle
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.scene.attitude import matrix_from_quaternion, quaternion_from_pointing
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.firmware_model.interface.cameras.mlx75412 import ROWS
from cubestack.host.errors import CameraFileError
from cubestack.host.experiments.aramis.measure import _count_wrong
from cubestack.host.experiments.cubestar.measure import (
    CubeStarOptions,
    _picture_truth,
    _views,
    count_wrong,
)
from cubestack.host.experiments.measure import measure


def test_debris_crosses_a_frame_during_its_exposure() -> None:
    devices = list[Any]()
    list(measure("cubestar", frames=2, hazard=("debris",), mag_limit=2.0, opened=devices.append))
    (emulated,) = devices
    (debris,) = emulated.scene.hazards
    exposed_s = emulated.board.stored[-1].mid_exposure_ps(ROWS / 2) / 1e12
    assert debris.at_s == pytest.approx(exposed_s, abs=0.1)


def camera_file(folder: Path, quaternion: list[float]) -> Path:
    path = folder / "camera.json"
    known = {"sky.png": {"quaternion_xyzw_inertial_to_camera": quaternion}}
    path.write_text(json.dumps({"images": known}), encoding="utf-8")
    return path


def test_truth_is_read_from_the_camera_file(tmp_path: Path) -> None:
    camera = camera_file(tmp_path, [0.5, -0.5, 0.1, 0.7])
    truth = _picture_truth(Path("elsewhere/sky.png"), camera)
    np.testing.assert_array_equal(truth, [0.5, -0.5, 0.1, 0.7])
    assert _picture_truth(Path("other.png"), camera) is None


@pytest.mark.parametrize("images", [[], {}, {"sky.png": 1}, {"other.png": {}}])
def test_camera_file_without_that_image_has_no_truth(images: object, tmp_path: Path) -> None:
    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps({"images": images}), encoding="utf-8")
    assert _picture_truth(Path("sky.png"), camera) is None


@pytest.mark.parametrize("quaternion", [[0, 0, 1], [0, 0, 0, 0, 1], [0, 0, 0.1, 1], [1, 0, 0, 1]])
def test_rejects_truth_that_is_no_unit_quaternion(quaternion: list[float], tmp_path: Path) -> None:
    with pytest.raises(CameraFileError, match=r"sky\.png's quaternion must be four of unit"):
        _picture_truth(Path("sky.png"), camera_file(tmp_path, quaternion))


def test_threshold_search_uses_five_skies_and_restores_the_scene() -> None:
    own = object()
    emulated: Any = SimpleNamespace(scene=own)
    seen = [emulated.scene for _ in _views(emulated, CubeStarOptions(seed=4))]
    assert len(seen) == 5
    assert len(np.unique([view.scene.quaternion for view in seen], axis=0)) == 5
    assert emulated.scene is own


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


def test_wrong_stars_are_unknown_without_truth() -> None:
    assert count_wrong(cubestar(0.0, 0.0, 9.0), None) is None
    emulated: Any = SimpleNamespace(board=SimpleNamespace(camera=SimpleNamespace(scene=object())))
    assert _count_wrong(emulated, [], None) is None
    assert _count_wrong(emulated, [], TRUTH) is None  # not of a sky
