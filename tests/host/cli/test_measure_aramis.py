"""Measuring with AraMiS by the command's own functions, with a small catalogue."""

import argparse
import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters, build_database
from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mt9m001.imager import Mt9m001Imager
from cubestack.emulator.camera.mt9m001.lens import CONDITION
from cubestack.emulator.camera.mt9m001.registers import read_settings
from cubestack.emulator.scene.attitude import attitude_error_deg, quaternion_from_pointing
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS
from cubestack.host.cli import aramis_session, measure_aramis


@pytest.fixture(scope="module")
def small() -> Database:
    return build_database(CatalogueParameters(step_deg=10, stars_per_field=5))


@pytest.fixture(autouse=True)
def _small_catalogue(monkeypatch: pytest.MonkeyPatch, small: Database) -> None:
    monkeypatch.setattr(aramis_session, "aramis_catalogue", lambda _field=0.0: small)


def parse(*arguments: object) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    measure_aramis.add_arguments(parser)
    return parser.parse_args([str(argument) for argument in arguments])


def measure(capsys: pytest.CaptureFixture[str], *arguments: object) -> list[dict[str, Any]]:
    assert measure_aramis.run(parse("--json", *arguments)) == 0
    output = capsys.readouterr()
    assert output.err == ""
    return [json.loads(line) for line in output.out.splitlines()]


def test_a_random_sky_lost_in_space(capsys: pytest.CaptureFixture[str]) -> None:
    frames = measure(capsys, "--frames", 3)
    assert [f["right"] for f in frames] == [True] * 3
    for frame in frames:
        assert (frame["outcome"], frame["reason"], frame["mode"]) == (
            "conclusive",
            "confirmed",
            "lis",
        )
        assert (frame["wrong"], frame["flips"], frame["status"]) == (0, 0, "")
        assert frame["error_cross_deg"] < 0.01
        assert len(frame["truth"]) == len(frame["quaternion"]) == 4
        assert frame["matched"] >= 3
        assert frame["phase_ms"]["total"] > 300
    assert frames[0]["truth"] != frames[1]["truth"]


def test_runs_repeat_but_for_the_wall_time(capsys: pytest.CaptureFixture[str]) -> None:
    first, again, other = (
        measure(capsys, "--frames", 1, "--seed", seed)[0] | {"wall_ms": 0} for seed in (4, 4, 5)
    )
    assert first == again
    assert first["truth"] != other["truth"]


def test_modes_noise_rates_and_published_settings(capsys: pytest.CaptureFixture[str]) -> None:
    aided = measure(capsys, "--mode", "assisted", "--hint-error", 4)[0]
    assert (aided["right"], aided["mode"]) == (True, "assisted")
    ideal = measure(capsys, "--no-noise")[0]
    quiet = measure(capsys, *(w for t in measure_aramis.NOISE_TERMS for w in ("--without", t)))[0]
    assert ideal["error_cross_deg"] == quiet["error_cross_deg"]
    published = measure(capsys, "--published", "--exposure", 100, "--gain", 8)[0]
    assert published["reason"] not in ("confirmed", "unconfirmed")
    turning = measure(capsys, "--roll-rate", 10, "--exposure", 100)[0]
    assert turning["right"]


def test_bits_turned_over_in_flash_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    frames = measure(capsys, "--bit-flips", 3e-6, "--frames", 2)
    for frame in frames:
        assert 0 < frame["corrected"] <= frame["flips"]
        assert (frame["right"], frame["lost"]) == (True, 0)
        assert frame["status"] in ("", "CatalogueCorrected")
    damaged = measure(capsys, "--bit-flips", 1e-2)[0]
    assert (damaged["solved"], damaged["right"], damaged["quaternion"]) == (False, False, None)
    assert damaged["reason"] in ("catalogue_damaged", "no_catalogue")


def test_a_scene_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "sky.toml"
    path.write_text('kind = "sky"\nra_deg = 84.0\ndec_deg = -1.0\n', encoding="utf-8")
    frames = measure(capsys, "--scene", path, "--frames", 2)
    assert frames[0]["truth"] == frames[1]["truth"]
    assert [f["right"] for f in frames] == [True] * 2


def test_a_picture_file_as_the_light(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    pointing = quaternion_from_pointing(84.0, -1.0, 20.0)
    scene = SkyScene(pointing)
    settings = read_settings(RegisterFile(REGISTERS))
    settings = replace(settings, exposure_rows=6299, gains=(15.0,) * 4)  # type: ignore[arg-type]
    shutter = RollingShutter(10**12, Fraction(31_750_000), 6299, 6299)
    sky = Mt9m001Imager().picture(scene, CONDITION, shutter, settings)
    wide = np.pad(sky, ((0, 20), (7, 0)))
    Image.fromarray(wide).save(tmp_path / "sky.png")
    frame = measure(capsys, "--image", tmp_path / "sky.png", "--crop", "7,0")[0]
    assert (frame["solved"], frame["right"], frame["truth"]) == (True, None, None)
    assert attitude_error_deg(np.array(frame["quaternion"]), pointing)[0] < 0.01


def test_a_table_for_readers(capsys: pytest.CaptureFixture[str]) -> None:
    assert measure_aramis.run(parse("--frames", 2)) == 0
    assert "100.0 % right" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--crop", "1,2"), "--crop belongs to --image"),
        (("--scene", "x.toml", "--rate", "1"), "belong to the random sky"),
        (("--image", "x.png", "--mode", "assisted"), "x.png"),
    ],
)
def test_options_that_make_no_sense_are_refused(arguments: tuple[str, ...], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        measure_aramis.run(parse("--json", *arguments))


@pytest.mark.parametrize("wrong", [("--field", "4"), ("--gain", "16"), ("--bit-flips", "2")])
def test_values_out_of_range_are_wrong_calls(wrong: tuple[str, str]) -> None:
    with pytest.raises(SystemExit):
        parse(*wrong)
