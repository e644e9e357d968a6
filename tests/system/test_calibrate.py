import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.camera.common.hazards.lenses import PrincipalPoint
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.scene.attitude import random_quaternion
from cubestack.emulator.scene.sky import SkyScene
from cubestack.host.calibration.camera import load_camera
from cubestack.host.cli.main import main
from cubestack.host.devices.registry import device
from cubestack.host.emulation.emulated import power_up

UNIT = """
kind = "sky"
ra_deg = 0
dec_deg = 0
[optics]
focal_length_mm = 6.31
cx = 545.0
cy = 170.0
k1 = 0.33
k2 = -0.13
p1 = -0.0030
p2 = 0.0055
"""


def calibrate(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict:
    assert main(["calibrate", "cubestar", "--json", *map(str, arguments)]) == 0
    return json.loads(capsys.readouterr().out)


def test_calibrate_finds_the_lens_of_an_emulated_cubestar(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """The model of a camera file is within 0.1 px of the tables' distortion."""
    scene, out = tmp_path / "unit.toml", tmp_path / "camera.json"
    scene.write_text(UNIT, encoding="utf-8")
    found = calibrate(capsys, "--emulated", 8, "--scene", scene, "--out", out)
    assert found["lens_px"] < 0.2
    assert found["after_px"] < 0.12 < 0.8 < found["before_px"]
    assert found["camera"]["f_px"] == pytest.approx(6310 / 5.6, abs=2)
    assert load_camera(out).f_px == found["camera"]["f_px"]
    with Image.open(out.with_suffix(".png")) as picture:
        assert picture.width > 900


def test_calibrate_finds_a_principal_point_from_stars_that_a_unit_reports(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """The unit has the tables' camera, and its lens is 8 px to the right."""
    file, rng = tmp_path / "stars.jsonl", np.random.default_rng(5)
    moved = PrincipalPoint(px=8.0)
    with power_up(device("cubestar"), None, profile="extended") as emulated, file.open("w") as log:
        for number in range(8):
            sky = SkyScene(random_quaternion(rng))
            emulated.scene = SkyView(sky, replace(CONDITION, hazards=(moved,), seed=number))
            emulated.client.capture_and_process()
            found = emulated.client.stars()
            log.write(json.dumps([[s.hipparcos, s.x_px, s.y_px] for s in found if s.hipparcos]))
            log.write("\n")
    fitted, tables = calibrate(capsys, "--stars", file), CONDITION.optics
    assert fitted["camera"]["cx_px"] == pytest.approx(tables.cx + 8, abs=0.7)
    assert fitted["camera"]["cy_px"] == pytest.approx(tables.cy, abs=0.7)
    assert fitted["after_px"] < 0.15
    assert fitted["lens_px"] is None


@pytest.mark.slow
def test_calibrate_finds_the_camera_of_photographs(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, photographs: Path
) -> None:
    some = tmp_path / "some"
    some.mkdir()
    for path in sorted(photographs.glob("*.jpg"))[:5]:
        (some / path.name).symlink_to(path)
    rough = tmp_path / "rough.json"
    rough.write_text('{"f_px": 1080, "cx_px": 511.5, "cy_px": 511.5}', encoding="utf-8")
    found = calibrate(capsys, "--images", some, "--camera", rough)
    truth = load_camera(photographs / "truth.json")
    assert found["camera"]["f_px"] == pytest.approx(truth.f_px, abs=2)
    assert found["camera"]["cx_px"] == pytest.approx(truth.cx_px, abs=5)
    assert found["camera"]["cy_px"] == pytest.approx(truth.cy_px, abs=5)
    assert found["after_px"] < 0.3 < 2 < found["before_px"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--images", "{tmp}/none.png"), "none.png can not be read"),
        (("--images", "{tmp}/small.png"), "is 8 x 8 pixels; with crop 0,0"),
        (("--images", "{tmp}/dark.tiff"), "needs 3 pictures with 5 identified stars or more; of 1"),
        (("--images", "{tmp}", "--scene", "x.toml"), "--scene requires --emulated"),
        (("--stars", "{tmp}/s.jsonl", "--scene", "x.toml"), "--scene requires --emulated"),
        (("--stars", "{tmp}/s.jsonl"), "s.jsonl: line 1"),
    ],
)
def test_invalid_arguments_print_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, arguments: tuple[str, ...], complaint: str
) -> None:
    Image.new("L", (8, 8)).save(tmp_path / "small.png")
    Image.new("L", (1024, 512)).save(tmp_path / "dark.tiff")
    (tmp_path / "s.jsonl").write_text("[[1, 2]]", "utf-8")
    told = [argument.replace("{tmp}", str(tmp_path)) for argument in arguments]
    assert main(["calibrate", "cubestar", *told]) == 2
    said = capsys.readouterr().err
    assert complaint in said.replace("\n", "", 1)
    assert said.count("\n") == 1
