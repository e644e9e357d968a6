import json
import shutil
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock, call

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.firmware_model.interface.aramis import OnOff
from cubestack.firmware_model.interface.cameras.mt9m001 import ROWS
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.telecommands import DISTORTION
from cubestack.firmware_model.interface.cubestar import IdMode
from cubestack.host.calibration.camera import Camera
from cubestack.host.calibration.fisheye import Fisheye
from cubestack.host.devices.registry import device
from cubestack.host.experiments.opener import Opener
from cubestack.host.studies import calibrate
from cubestack.host.studies.aramis.calibrate import EXPERIMENT as ARAMIS
from cubestack.host.studies.calibrate import CalibrateOptions, CalibrateResult
from cubestack.host.studies.cubesense import calibrate as cubesense
from cubestack.host.studies.cubestar.calibrate import EXPERIMENT as CUBESTAR

TRUE = Fisheye(322.5, 239.0, DISTORTION, codes.PIXELS_PER_DEGREE, 95.0)
ANGLES = np.array([(a, b) for a in range(-60, 61, 24) for b in range(-50, 51, 20)], float)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lights")
    rows, columns = np.mgrid[:480, :640]
    lines = ["file,alpha_deg,beta_deg"]
    for number, (angles, (x, y)) in enumerate(zip(ANGLES, TRUE.project(ANGLES), strict=True)):
        spot = 30 + 200 * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 18)
        Image.fromarray(spot.astype(np.uint8)).save(folder / f"{number}.png")
        lines.append(f"{number}.png,{angles[0]},{angles[1]}")
    (folder / "angles.csv").write_text("\n".join(lines) + "\n", "utf-8")
    return folder


@pytest.fixture
def lights(pictures: Path, tmp_path: Path) -> Path:
    """A folder with pictures of one light each, and angles.csv."""
    return shutil.copytree(pictures, tmp_path, dirs_exist_ok=True)


def calibrated(folder: Path, **more: Any) -> list[cubesense.CalibrateResult]:
    options = cubesense.CalibrateOptions(
        sensor="sun", images=folder, angles=folder / "angles.csv", **more
    )
    return list(cubesense.EXPERIMENT.run(Opener(device("cubesense")), options))


def test_calibrate_fits_a_lens_to_images_of_lights(lights: Path) -> None:
    (found,) = calibrated(lights, out=lights / "out.json")
    assert (found.sensor, found.places) == ("sun", len(ANGLES))
    assert found.boresight_px == pytest.approx((322.5, 239.0), abs=0.1)
    assert found.after_px < 0.1 < found.before_px
    assert (found.error_before_deg, found.error_after_deg) == (None, None)
    fitted = Fisheye(*found.boresight_px, found.factors, codes.PIXELS_PER_DEGREE, 95.0)
    np.testing.assert_allclose(fitted.project(ANGLES), TRUE.project(ANGLES), atol=0.2)
    told = json.loads((lights / "out.json").read_text("utf-8"))
    assert set(told) == {"sun"}
    assert told["sun"]["places"] == found.places


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, r"angles\.csv can not be read: No such file"),
        ("file,alpha_deg\n0.png,1\n", "angles.csv, line 2: must be file,alpha_deg,beta_deg"),
        ("file,alpha_deg,beta_deg\n0.png,1,2\n1.png,x,2\n", "angles.csv, line 3: must be"),
        ("alpha_deg,beta_deg\n1,2\n", "angles.csv, line 2: must be"),
        ("file,alpha_deg,beta_deg\n0.png,1\n", "angles.csv, line 2: must be"),
        ("file,alpha_deg,beta_deg\nnone.png,1,2\n", "none.png"),
    ],
)
def test_names_an_invalid_line_of_angles(lights: Path, text: str | None, message: str) -> None:
    (lights / "angles.csv").unlink()
    if text is not None:
        (lights / "angles.csv").write_text(text, "utf-8")
    with pytest.raises(ValueError, match=message):
        calibrated(lights)


@pytest.mark.parametrize(("above", "seen"), [(19, False), (21, True)])
def test_calibration_light_must_be_20_grey_values_above_background(
    lights: Path, above: int, seen: bool
) -> None:
    picture = np.full((480, 640), 30, np.uint8)
    picture[100:103, 200:203] += above
    Image.fromarray(picture).save(lights / "0.png")
    if seen:
        calibrated(lights)
        return
    with pytest.raises(ValueError, match=r"0\.png shows no light 20 grey values above"):
        calibrated(lights)


RESULT = cubesense.CalibrateResult(
    "nadir", (371.25, 236.5), (0.1, 0.995, 7.6e-5), 900, 1.25, 0.125, 0.5, 0.0625
)


def test_summary_has_the_telecommand_parameters() -> None:
    lines = list(cubesense.EXPERIMENT.summarise([RESULT], 2.0))
    assert lines == [
        "nadir: 900 places; 1.250 px from the tables",
        "  after the fit 0.125 px",
        "  Boresight2 X=371.25 Y=236.50",
        "  Distortion2, from the constant up: 0.1 0.995 7.6e-05",
        "  error at random poses: mean 0.500 deg before, 0.062 deg after",
        "2.0 s wall time",
    ]
    pictures = replace(RESULT, sensor="sun", error_before_deg=None, error_after_deg=None)
    lines = list(cubesense.EXPERIMENT.summarise([pictures], 2.0))
    assert "  Boresight1 X=371.25 Y=236.50" in lines
    assert not any("random poses" in line for line in lines)


class _Named(type(CUBESTAR)):  # type: ignore[misc]
    """A unit that identifies every star exactly; each picture shows another sky."""

    lens = Camera(1120.0, 530.0, 240.0)

    def load(self, client: Iterator[Rotation], camera: Camera, light: Path | None) -> None:
        pass

    def identify(self, client: Iterator[Rotation]) -> list[SimpleNamespace]:
        sky = load_sky()
        seen = sky.vectors @ next(client).as_matrix()
        ahead = np.flatnonzero((seen[:, 2] > 0.9) & (sky.v_mag < 4))
        places = self.lens.directions(seen[ahead])
        inside = ((places > 0) & (places < self.size)).all(axis=1)
        return [
            SimpleNamespace(x_px=x, y_px=y, hipparcos=number)
            for (x, y), number in zip(places[inside], sky.hip[ahead][inside].tolist(), strict=True)
        ]


class Powered:
    """Opens a device with that client."""

    def __init__(self, client: Any) -> None:
        self.client = client

    def __call__(self, scene: object, **_options: object) -> Any:
        return nullcontext(SimpleNamespace(scene=scene, client=self.client))

    def shown(self, items: Any, _total: int, _label: str) -> Any:
        return iter(items)


def test_principal_point_of_an_emulated_unit_counts_from_the_sensor_corner(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(calibrate, "GRID", (9, 5))  # quicker
    powered: Any = Powered(iter(Rotation.random(20, random_state=3)))
    (found,) = _Named().run(powered, CalibrateOptions(emulated=4, rounds=1))
    assert found.after_px < 1e-6
    assert (found.camera["cx_px"], found.camera["cy_px"]) == pytest.approx((530, 240), abs=1e-3)


BOTH = {"images": "x", "angles": "y"}
STARS = CalibrateResult(
    camera={"f_px": 1071.5, "cx_px": 512.25, "k1": -0.1},
    sigma={"f_px": 0.125, "cx_px": 0.25},
    **{"pictures": 18, "tried": 20, "stars": 150, "rejected": 3},
    **{"pairs_f_px": 1071.25, "before_px": 2.5, "after_px": 0.0625, "lens_px": 0.015625},
)


def test_summary_has_the_camera_with_sigmas() -> None:
    assert list(CUBESTAR.summarise([STARS], 1.5)) == [
        "150 stars of 18 pictures (20 tried, 3 stars left out)",
        "f_px     1071.50000 +- 0.12500",
        "cx_px     512.25000 +- 0.25000",
        "focal length by star pairs near the middle: 1071.2 px",
        "residual: 2.500 px before, 0.062 px after",
        "from the emulated unit's own lens: 0.016 px",
        "1.5 s wall time",
    ]
    unknown = list(CUBESTAR.summarise([replace(STARS, pairs_f_px=None, lens_px=None)], 1.5))
    assert not any("star pairs" in line or "own lens" in line for line in unknown)


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        (CalibrateOptions, {"images": "x", "scene": "y"}, "--scene requires --emulated"),
        (CalibrateOptions, {"out": "x.txt"}, "--out must be a file NAME.json"),
        (CalibrateOptions, {"out": "no/such/x.json"}, "--out must be a file NAME.json"),
        (cubesense.CalibrateOptions, {"images": "x"}, "--images and --angles are needed together"),
        (cubesense.CalibrateOptions, {"angles": "x"}, "--images and --angles are needed together"),
        (cubesense.CalibrateOptions, BOTH, "--images are of one camera"),
        (cubesense.CalibrateOptions, BOTH | {"sensor": "sun", "scene": "z"}, "without --scene"),
    ],
)
def test_rejects_options_that_exclude_each_other(kind: Any, options: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        kind(**options)


def test_images_of_a_folder_are_sorted_by_name(tmp_path: Path) -> None:
    assert CalibrateOptions().pictures == []
    with pytest.raises(ValueError, match="has no pictures: "):
        CalibrateOptions(images=tmp_path).pictures  # noqa: B018
    for name in ("b.png", "a.JPG", "c.txt"):
        (tmp_path / name).write_bytes(b"")
    assert [one.name for one in CalibrateOptions(images=tmp_path).pictures] == ["a.JPG", "b.png"]
    assert CalibrateOptions(images=tmp_path / "c.txt").pictures == [tmp_path / "c.txt"]
    assert CalibrateOptions(out=tmp_path / "x.json").out == tmp_path / "x.json"


def test_load_sets_the_field_before_it_activates_the_catalogue() -> None:
    """A focal length of half the picture's height has it 90 degrees high."""
    aramis = Mock()
    ARAMIS.load(aramis, Camera(ROWS / 2, 640.0, 512.0), None)
    field = call.client.command("SetField", FieldOfView=pytest.approx(90.0), Round=OnOff.ON)
    assert aramis.mock_calls == [field, call.client.wait_processed(1.0), call.activate()]


class Unit:
    """A CubeStar in tracking mode; ``modes`` are the identification modes of its pictures."""

    def __init__(self, valid: bool) -> None:
        self.valid = valid
        self.modes = list[IdMode]()
        self._mode = IdMode.TRACKING
        self.client = self

    def command(self, _name: str, *, IdMode: IdMode) -> None:
        self._mode = IdMode

    def capture_and_process(self) -> None:
        self.modes.append(self._mode)

    def attitude(self) -> "Unit":
        return self

    def stars(self) -> list[str]:
        return ["a star"]


@pytest.mark.parametrize("valid", [True, False])
def test_calibration_frames_use_lost_in_space_and_need_an_attitude(valid: bool) -> None:
    unit: Any = Unit(valid)
    assert CUBESTAR.identify(unit) == (["a star"] if valid else [])
    assert unit.modes == [IdMode.LOST_IN_SPACE]


LENS = Fisheye(300.0, 250.0, (0.5, 1.0, 0.0, 0.0, 0.0), 1.45, 95.0)


def test_fitted_lens_is_loaded_before_the_second_error(monkeypatch: pytest.MonkeyPatch) -> None:
    client, options = Mock(), cubesense.CalibrateOptions(check_poses=3)

    def measured(*_: object) -> SimpleNamespace:
        told = client.set_boresight.called and client.set_distortion.called
        return SimpleNamespace(error_deg=0.25 if told else 1.5)

    monkeypatch.setattr(cubesense, "measure_once", measured)
    opened: Any = Powered(client)
    assert cubesense._checked(opened, options, codes.Camera.SUN, LENS) == (1.5, 0.25)
    client.set_boresight.assert_called_once_with(codes.Camera.SUN, 300.0, 250.0)
    client.set_distortion.assert_called_once_with(codes.Camera.SUN, LENS.factors)
