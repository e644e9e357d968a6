import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.camera.ov7620.fisheye import lens_of
from cubestack.emulator.camera.ov7620.lens_error import LensError, draw_lens
from cubestack.emulator.scene.attitude import vector_from_angles
from cubestack.emulator.scene.earth_sun import CameraTarget
from cubestack.host.cli.main import main

LENS = "[{}_lens]\ncentre_px = [0.8, -0.5]\nradial_deg = [[40.0, 0.2], [75.0, 1.0]]\n"


def calibrate(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict:
    assert main(["calibrate", "cubesense", "--json", *map(str, arguments)]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_calibration_reduces_the_error(capsys: pytest.CaptureFixture[str]) -> None:
    which = ("--sensor", "nadir", "--seed", 2, "--emulated", 20, "--check-poses", 8)
    found = calibrate(capsys, *which, "--profile", "extended", "--set", "lens=residuals")
    assert found["error_after_deg"] < 0.06 < 0.2 < found["error_before_deg"]
    centre = np.add((371, 236), draw_lens(CameraTarget.NADIR, 2).centre_px)
    np.testing.assert_allclose(found["boresight_px"], centre, atol=0.15)


@pytest.mark.slow
def test_calibrate_finds_the_lens_of_a_scene(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    scene, out = tmp_path / "unit.toml", tmp_path / "unit.json"
    scene.write_text('kind = "earth-sun"\n' + LENS.format("sun"), encoding="utf-8")
    which = ("--sensor", "sun", "--scene", scene, "--emulated", 24, "--check-poses", 6)
    found = calibrate(capsys, *which, "--profile", "extended", "--out", out)
    np.testing.assert_allclose(found["boresight_px"], (369.8, 249.5), atol=0.1)
    assert found["error_after_deg"] < 0.5 * found["error_before_deg"]
    assert json.loads(out.read_text(encoding="utf-8"))["sun"].items() <= found.items()


def test_calibrate_finds_the_lens_from_images_of_lights(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    lens = lens_of(CameraTarget.NADIR, LensError((0.8, -0.5), ((40.0, 0.2), (75.0, 0.6))))
    lines = ["file,alpha_deg,beta_deg"]
    y, x = np.mgrid[:480, :640]
    for number, turn in enumerate(np.arange(0, 20, 1.3)):
        alpha, beta = (3.5 * turn * np.cos(turn), 3.5 * turn * np.sin(turn) + 1)
        column, row = lens.project(vector_from_angles(alpha, beta))
        spot = 30 + 150 * np.exp(-((x - column) ** 2 + (y - row) ** 2) / 18)
        Image.fromarray(spot.astype(np.uint8)).save(tmp_path / f"{number}.png")
        lines.append(f"{number}.png,{alpha},{beta}")
    csv = tmp_path / "bench.csv"
    csv.write_text("\n".join(lines), encoding="utf-8")
    given = ("--images", tmp_path, "--angles", csv, "--sensor", "nadir")
    found = calibrate(capsys, *given)
    np.testing.assert_allclose(found["boresight_px"], (371.8, 235.5), atol=0.1)
    assert found["after_px"] < 0.3 < 1 < found["before_px"]
    csv.write_text("\n".join(lines[:5]), encoding="utf-8")
    assert main(["calibrate", "cubesense", *map(str, given)]) == 2
    said = capsys.readouterr().err
    assert "needs 8 places at least; 4 were found" in said
    assert said.count("\n") == 1
