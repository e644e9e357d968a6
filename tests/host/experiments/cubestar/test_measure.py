import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.interface.cameras.mlx75412 import ROWS
from cubestack.host.errors import CameraFileError
from cubestack.host.experiments.cubestar.measure import CubeStarOptions, _picture_truth, _views
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
def test_camera_file_without_the_picture_has_no_truth(images: object, tmp_path: Path) -> None:
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
