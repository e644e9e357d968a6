import json
import re
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.calibration.camera import Camera, load_camera
from cubestack.host.clients.cubestar.operator import LADDER, Calibration, calibrate, find_threshold
from cubestack.host.errors import CameraFileError
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


def test_find_threshold_breaks_ties_by_votes() -> None:
    # Of n stars, each has at most n - 1 others that vote for it.
    sky: Any = Sky({6: (9, 5, 4), 25: (9, 5, 9), 32: (9, 6, 3)})
    assert find_threshold(sky) == 25
    sky = Sky({6: (9, 5, 4), 25: (9, 5, 3)})
    assert find_threshold(sky) == 6


def test_find_threshold_adds_matches_of_several_views() -> None:
    skies = [{6: (9, 6, 9)}, {10: (9, 5, 9)}, {10: (9, 4, 9)}]
    sky: Any = Sky({})

    def views() -> Any:
        for seen in skies:
            sky.seen = seen
            yield

    assert find_threshold(sky, views()) == 10
    assert sky.captured == 3


def test_threshold_is_restored_when_no_sky_is_solved() -> None:
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


# The camera of the photographs that the project is tried on, cropped to its middle rows.
DISTORTION = {"k1": 0.17323, "k2": -0.310181, "p1": -0.000718546, "p2": -0.000419435}
PHOTOGRAPHS = Camera(f_px=1070.949, cx_px=505.354, cy_px=230.801, **DISTORTION)


def firmware_points(settings: dict[str, dict[str, float]], pixels: Any) -> NDArray[np.float64]:
    """X/Z and Y/Z of pixels as the firmware computes them, from what the telecommands carry."""
    carried: dict[str, Any] = {}
    for name, parameters in settings.items():
        message = INTERFACE.telecommand(name)
        values = message.unpack(message.pack(**parameters))
        assert not message.violations(values)
        carried |= values
    x = (pixels[:, 0] - carried["Cx"]) / carried["Fx"]
    y = (pixels[:, 1] - carried["Cy"]) / carried["Fy"]
    r2 = x**2 + y**2
    radial = 1 + carried["K1"] * r2 + carried["K2"] * r2**2
    x_u = x * radial + carried["P2"] * (r2 + 2 * x**2) + 2 * carried["P1"] * x * y
    y_u = y * radial + carried["P1"] * (r2 + 2 * y**2) + 2 * carried["P2"] * x * y
    scale = 0.0056 / carried["FocalLength"]
    return np.stack([x_u * carried["Fx"] * scale, y_u * carried["Fy"] * scale], axis=-1)


def frame_points(rng: np.random.Generator, camera: Camera) -> NDArray[np.float64]:
    points = rng.uniform(-0.6, 0.6, (4000, 2))
    pixels = camera.project(points)
    inside = ((pixels > 0) & (pixels < [1023, 511])).all(axis=1)
    assert inside.sum() > 500
    return points[inside]


def test_firmware_corrects_the_distortion_within_the_residual() -> None:
    calibration = calibrate(PHOTOGRAPHS)
    points = frame_points(np.random.default_rng(1), PHOTOGRAPHS)
    found = firmware_points(calibration.settings, PHOTOGRAPHS.project(points))
    error_px = PHOTOGRAPHS.f_px * np.hypot(*(found - points).T)
    assert error_px.max() <= calibration.max_px * 1.05
    assert np.sqrt(np.mean(error_px**2)) == pytest.approx(calibration.rms_px, rel=0.2)
    assert calibration.rms_px < 0.03


def test_calibration_without_distortion_is_exact() -> None:
    calibration = calibrate(Camera(1100.0, 500.0, 250.0))
    assert calibration.max_px < 1e-9
    assert calibration.settings["setFocalLength"]["FocalLength"] == pytest.approx(1100 * 0.0056)
    for name in ("setRadialDistortionGains", "setTangentalDistortionGains"):
        assert all(abs(value) < 1e-9 for value in calibration.settings[name].values())


def test_calibration_minimises_the_distortion_error() -> None:
    best = calibrate(PHOTOGRAPHS)
    pixels = np.stack(np.meshgrid(np.linspace(0, 1023, 128), np.linspace(0, 511, 64)), -1)
    pixels = pixels.reshape(-1, 2)
    true = PHOTOGRAPHS.unproject(pixels)

    def cost(calibration: Calibration) -> float:
        return float(np.sum((firmware_points(calibration.settings, pixels) - true) ** 2))

    for name, parameters in best.settings.items():
        if name in ("setPrincipalPoint", "setFocalLengthComponents"):
            continue
        for parameter in parameters:
            for factor in (0.99, 1.01):
                other = {key: dict(value) for key, value in best.settings.items()}
                other[name][parameter] *= factor
                assert cost(Calibration(other, 0.0, 0.0)) > cost(best)


def test_camera_projection_matches_a_hand_calculation() -> None:
    # x = 0.2, y = 0, so r2 = 0.04.
    camera = Camera(1000.0, 500.0, 250.0, k1=0.5, k2=0.25, p1=0.01, p2=0.02)
    column = 500 + 1000 * (0.2 * (1 + 0.5 * 0.04 + 0.25 * 0.0016) + 0.02 * (0.04 + 0.08))
    row = 250 + 1000 * 0.01 * 0.04
    np.testing.assert_allclose(camera.project(np.array([0.2, 0.0])), [column, row])


GOOD: dict[str, Any] = {"f_px": 1000, "cx_px": 512.5, "cy_px": 256.0, "k1": 0.1, "model": "any"}


@pytest.mark.parametrize("content", [GOOD, {"camera": GOOD, "images": {}}])
def test_camera_file_may_have_a_camera_object(content: Any, tmp_path: Path) -> None:
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(content))
    assert load_camera(path) == Camera(1000.0, 512.5, 256.0, k1=0.1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "No such file or directory"),
        ("{", "is not valid JSON: Expecting property name"),
        ("[1]", "must hold an object with f_px, cx_px, cy_px"),
        ('{"camera": 1}', "must hold an object"),
        ('{"cx_px": 1, "cy_px": 1}', "camera has no f_px; needed: f_px, cx_px, cy_px"),
        ('{"f_px": "1", "cx_px": 1, "cy_px": 1}', "f_px must be a number, not '1'"),
        ('{"f_px": true, "cx_px": 1, "cy_px": 1}', "f_px must be a number, not True"),
        ('{"f_px": NaN, "cx_px": 1, "cy_px": 1}', "f_px must be a number, not nan"),
        ('{"f_px": 0, "cx_px": 1, "cy_px": 1}', "f_px must be above 0, not 0"),
        ('{"f_px": 9, "cx_px": 1, "cy_px": 1, "k1": null}', "k1 must be a number, not None"),
    ],
)
def test_rejects_invalid_camera_files(text: str | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / "camera.json"
    if text is not None:
        path.write_text(text)
    expected = rf"^{re.escape(str(path))}(: .*| ){re.escape(message)}.*\Z"
    with pytest.raises(CameraFileError, match=expected):
        load_camera(path)
