from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import cubestack
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.attitude import attitude_error_deg
from tests.conftest import Run


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_uploaded_rendered_image_yields_its_attitude(run: Run, tmp_path: Path) -> None:
    path, scene = tmp_path / "orion.png", tmp_path / "dark.toml"
    scene.write_text('kind = "sky"\nra_deg = 1\ndec_deg = 2\nmag_limit = 3.8\n')
    pose = ("--ra", "83.8", "--dec", "-5.4", "--roll", "30")
    code, out, _ = run("picture", "cubestar", *pose, "--scene", str(scene), "--out", str(path))
    assert code == 0
    assert "ra_deg 83.8000 dec_deg -5.4000 roll_deg 30.0000" in out
    quaternion = [float(word) for word in out.split("quaternion ")[1].split()]
    with cubestack.open_device("cubestar", profile="extended") as device:
        with Image.open(path) as picture:
            device.client.upload_image(np.asarray(picture))
        device.client.process_image()
        attitude = device.client.attitude()
    assert attitude.valid
    cross, roll = attitude_error_deg(attitude.quaternion, quaternion)
    assert cross < 0.01
    assert abs(roll) < 0.02


def test_picture_command_renders_an_aramis_sky(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "sky.png"
    code, out, err = run("picture", "aramis", "--ra", "10", "--dec", "20", "--out", str(path))
    with Image.open(path) as picture:
        assert (code, picture.size) == (0, (1280, 1024))
    assert "roll_deg 0.0000" in out
    assert "1280 x 1024 pixels" in err


def test_stretched_brightens_faint_stars(run: Run, tmp_path: Path) -> None:
    pictures = []
    for words in ((), ("--stretched",)):
        path = tmp_path / f"sky{len(pictures)}.png"
        pose = ("--ra", "84", "--dec", "-1", "--seed", "3")
        assert run("picture", "cubestar", *pose, *words, "--out", str(path))[0] == 0
        with Image.open(path) as picture:
            pictures.append(np.asarray(picture).astype(int))
    raw, shown = pictures
    faint = (raw > np.median(raw) + 8) & (raw < 60)
    assert faint.any()
    assert np.all(shown[faint] > raw[faint])
    assert np.median(shown) == 0


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (("cubestar", "--ra", "1"), "a pose needs both --ra and --dec"),
        (("cubestar", "--roll", "1"), "a pose needs both --ra and --dec"),
        (("cubestar",), "needs a pose, --ra and --dec, or --scene FILE"),
        (("cubestar", "--ra", "1", "--dec", "91"), "--dec: must be -90 to 90 deg, not 91"),
        (("cubesense", "--ra", "1", "--dec", "2"), "cubesense is no star tracker"),
        (("cubestar", "--scene", "none.toml"), "none.toml can not be read"),
        (("cubestar", "--ra", "1", "--dec", "2", "--out", "x.jpg"), "--out must end in .png"),
    ],
)
def test_picture_command_rejects_wrong_arguments(
    run: Run, arguments: tuple[str, ...], error: str
) -> None:
    code, out, err = run("picture", "--out", "x.png", *arguments)
    assert (code, out) == (2, "")
    assert error in err
