import json
from pathlib import Path

import pytest
from PIL import Image

from cubestack.host.calibration.camera import load_camera
from cubestack.host.cli.main import main

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
    ],
)
def test_invalid_arguments_print_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, arguments: tuple[str, ...], complaint: str
) -> None:
    Image.new("L", (8, 8)).save(tmp_path / "small.png")
    Image.new("L", (1024, 512)).save(tmp_path / "dark.tiff")
    told = [argument.replace("{tmp}", str(tmp_path)) for argument in arguments]
    assert main(["calibrate", "cubestar", *told]) == 2
    said = capsys.readouterr().err
    assert complaint in said.replace("\n", "", 1)
    assert said.count("\n") == 1
