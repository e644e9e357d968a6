"""The command: what it takes, exit codes, one-line errors, and output for scripts."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from PIL import Image

from cubestack.host.cli.main import COMMANDS, main
from cubestack.host.cli.reports import reports
from cubestack.host.experiments.cubestar.demo import RENDERED

DONE, FAILED, WRONG_CALL = 0, 1, 2


class Outcome(NamedTuple):
    code: int
    out: str
    err: str


Run = Callable[..., Outcome]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs the command with arguments, as the shell would see it."""

    def call(*arguments: object) -> Outcome:
        capsys.readouterr()
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as end:  # argparse's way out
            code = int(end.code or 0)
        return Outcome(code, *capsys.readouterr())

    return call


def check_one_line(outcome: Outcome, *words: str) -> None:
    """A wrong call: one line that names what is wrong and what would be right."""
    assert outcome.code == WRONG_CALL
    assert outcome.out == ""
    (message,) = outcome.err.splitlines()
    for word in words:
        assert word in message


def dark_picture(path: Path, size: tuple[int, int] = (1024, 512)) -> Path:
    """A picture file, columns x rows."""
    Image.fromarray(np.zeros(size[::-1], np.uint8)).save(path)
    return path


@pytest.mark.parametrize("command", [None, *COMMANDS, *reports()])
def test_help(run: Run, command: str | None) -> None:
    outcome = run(*([command] if command else []), "--help")
    assert outcome.code == DONE
    assert outcome.out.startswith("usage: cubestack")
    assert outcome.err == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), ("COMMAND",)),
        (("launch",), ("launch", "measure")),
        (("measure",), ("device",)),
        (("measure", "cubestarr"), ("cubestarr", "cubestar")),
        (("emulate", "cubestarr"), ("cubestarr", "cubestar")),
        (("measure", "cubestar", "--frames", "0"), ("0", "at least 1")),
        (("measure", "cubestar", "--frames", "many"), ("many", "at least 1")),
        (("measure", "cubestar", "--crop", "0;256"), ("0;256", "0,256")),
        (("measure", "cubestar", "--crop", "0,256"), ("--crop", "--image")),
        (("measure", "cubestar", "--camera", "c.json"), ("--camera", "--image")),
        (("measure", "cubestar", "--image", "a.png", "--scene", "b.toml"), ("--scene", "--image")),
        (("measure", "cubestar", "--false-stars", "-1"), ("false", "-1")),
        (("measure", "cubestar", "--mag-limit", "nan"), ("mag-limit", "nan", "number")),
        (("measure", "cubestar", "--scene", "a.toml", "--mag-limit", "3"), ("scene", "mag_limit")),
        (("measure", "cubestar", "--image", "a.png", "--false-stars", "1"), ("--false-stars",)),
        (("measure", "cubestar", "--image", "a.png", "--no-noise"), ("--no-noise",)),
        (("catalogue", "--epoch", "inf"), ("epoch", "inf", "number")),
        (("demo", "--seed", "-1"), ("seed", "-1")),
        (("measure", "cubestar", "--seed", "-1"), ("seed", "-1")),
        (("measure", "cubestar", "--hint-error", "-5", "--mode", "assisted"), ("hint", "-5")),
        (("measure", "cubestar", "--mode", "guessing"), ("guessing", "tracking")),
        (("emulate", "cubestar", "--pty", "a", "--tcp", "4000"), ("--pty", "--tcp")),
        (("emulate", "cubestar", "--tcp", "70000"), ("70000", "65535")),
        (("emulate", "aramis", "--engine", "compiled"), ("--engine", "FPGA")),
        (("emulate", "cubestar", "cubestar"), ("once", "cubestar")),
        (("emulate", "cubestar", "--mcu-addressing"), ("--mcu-addressing", "cubesense")),
        (("emulate", "cubestar", "aramis", "--scene", "a.toml"), ("--scene", "several")),
        (("emulate", "cubestar", "aramis", "--record", "a"), ("--record", "several")),
        (("emulate", "cubestar", "--i2c", "256"), ("256", "255")),
        (("emulate", "cubestar", "--baud", "0"), ("baud", "0")),
        (("emulate", "cubestar", "--pace", "slow"), ("slow", "fast")),
        (("registers", "cubestar", "--format", "pdf"), ("pdf", "markdown")),
        (("measure", "cubestar", "--scene", "missing.toml"), ("missing.toml", "No such file")),
        (("measure", "cubestar", "--image", "missing.png"), ("missing.png", "No such file")),
    ],
)
def test_wrong_calls(run: Run, arguments: tuple[str, ...], words: tuple[str, ...]) -> None:
    check_one_line(run(*arguments), *words)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("kind = sky", ("no TOML",)),
        ('kind = "sea"', ("kind", "sky", "sea")),
        ('kind = "sky"\nra_deg = 1.0', ("dec_deg",)),
        ('kind = "sky"\nra_deg = 1.0\ndec_deg = 2.0\ncolour = 3', ("colour", "mag_limit")),
        ('kind = "sky"\nra_deg = "east"\ndec_deg = 2.0', ("ra_deg", "number")),
        ('kind = "picture"', ("file",)),
        ('kind = "picture"\nfile = "none.png"', ("none.png",)),
    ],
)
@pytest.mark.parametrize("command", ["measure", "emulate"])
def test_wrong_scenes(
    run: Run, tmp_path: Path, command: str, text: str, words: tuple[str, ...]
) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(text, encoding="utf-8")
    check_one_line(run(command, "cubestar", "--scene", scene), "scene.toml", *words)


@pytest.mark.parametrize(
    ("size", "crop", "words"),
    [
        ((640, 480), "0,0", ("640 x 480", "1024 x 512")),
        ((1024, 1024), "0,600", ("1024 x 1024", "1024 x 1112")),
        ((1024, 512), "1,0", ("1025 x 512",)),
    ],
)
def test_wrong_pictures(
    run: Run, tmp_path: Path, size: tuple[int, int], crop: str, words: tuple[str, ...]
) -> None:
    picture = dark_picture(tmp_path / "sky.png", size)
    check_one_line(run("measure", "cubestar", "--image", picture, "--crop", crop), *words)


def test_a_wrong_picture_format(run: Run, tmp_path: Path) -> None:
    picture = dark_picture(tmp_path / "sky.gif")
    check_one_line(run("measure", "cubestar", "--image", picture), "GIF", "PNG, JPEG, TIFF")
    picture.write_text("stars")
    check_one_line(run("measure", "cubestar", "--image", picture), "no picture", "PNG, JPEG, TIFF")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", ("not JSON",)),
        ("{}", ("f_px",)),
        ('{"f_px": 1071, "cx_px": 5}', ("cy_px",)),
        (
            '{"f_px": 1071, "cx_px": 512, "cy_px": 256, '
            '"images": {"sky.png": {"quaternion_xyzw_inertial_to_camera": [1, 2]}}}',
            ("sky.png", "four"),
        ),
    ],
)
def test_wrong_cameras(run: Run, tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    picture, camera = dark_picture(tmp_path / "sky.png"), tmp_path / "camera.json"
    camera.write_text(text, encoding="utf-8")
    outcome = run("measure", "cubestar", "--image", picture, "--camera", camera)
    check_one_line(outcome, "camera.json", *words)


@pytest.mark.parametrize("images", ["[]", "{}", '{"sky.png": 1}', '{"other.png": {}}'])
def test_a_camera_that_does_not_know_the_picture(run: Run, tmp_path: Path, images: str) -> None:
    picture, camera = dark_picture(tmp_path / "sky.png"), tmp_path / "camera.json"
    camera.write_text(
        f'{{"f_px": 1071, "cx_px": 512, "cy_px": 256, "images": {images}}}', encoding="utf-8"
    )
    outcome = run("measure", "cubestar", "--image", picture, "--camera", camera, "--json")
    assert outcome.code == DONE
    assert json.loads(outcome.out)["truth"] is None


def test_no_compiler(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cubestack.emulator.rtl.cxxrtl.build.find_compiler", lambda: None)
    outcome = run("measure", "cubestar", "--engine", "compiled")
    assert (outcome.code, outcome.out) == (FAILED, "")
    (line,) = outcome.err.splitlines()
    assert "no C++ compiler" in line


def test_the_shipped_picture_is_found_from_anywhere(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert RENDERED.is_file()
    assert RENDERED.with_suffix(".json").is_file()


def test_a_path_that_is_taken(run: Run, tmp_path: Path) -> None:
    taken = tmp_path / "ttyCUBESTAR"
    taken.write_text("a file of the user's", encoding="utf-8")
    outcome = run("emulate", "cubestar", "--pty", taken)
    assert outcome.code in (FAILED, WRONG_CALL)
    assert outcome.out == ""
    (line,) = outcome.err.splitlines()
    assert "ttyCUBESTAR exists already" in line
    assert "choose another" in line
    assert taken.read_text(encoding="utf-8") == "a file of the user's"


def test_a_path_without_folder(run: Run, tmp_path: Path) -> None:
    outcome = run("emulate", "cubestar", "--pty", tmp_path / "nowhere" / "tty")
    assert outcome.code in (FAILED, WRONG_CALL)
    (line,) = outcome.err.splitlines()
    assert "nowhere" in line
    assert not os.path.lexists(tmp_path / "nowhere")


def test_registers_as_json(run: Run) -> None:
    outcome = run("registers", "cubestar", "--format", "json")
    assert (outcome.code, outcome.err) == (DONE, "")
    assert "CaptureAndProcess" in outcome.out
    json.loads(outcome.out)


@pytest.mark.parametrize(("limit_deg", "published"), [(42.101, 11_484), (42.105, 11_486)])
def test_catalogue_as_json(run: Run, limit_deg: float, published: int) -> None:
    outcome = run("catalogue", "--pair-limit", limit_deg, "--json")
    assert (outcome.code, outcome.err) == (DONE, "")
    facts: dict[str, Any] = json.loads(outcome.out)
    assert (facts["stars"], facts["pairs"]) == (405, published)
    assert np.round(facts["closest_pairs_rad"], 4).tolist() == [0.0017, 0.0067]


def test_catalogue_for_people(run: Run) -> None:
    outcome = run("catalogue", "--mag-limit", 3)
    assert outcome.code == DONE
    assert "stars" in outcome.out


def test_memory_report_names_every_buffer_and_fits(run: Run) -> None:
    outcome = run("memory", "cubesense", "--json")
    assert outcome.code == DONE
    ram = json.loads(outcome.out)["RAM"]
    assert ram["used"] <= ram["bytes"] == 1536
    assert {"Sun window", "edges", "software stack"} <= ram["buffers"].keys()
    table = run("memory", "cubesense")
    assert all(name in table.out for name in ram["buffers"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--frames", "0"), ("0", "at least 1")),
        (("--altitude", "-3"), ("altitude", "above 0")),
        (("--sensor", "star"), ("star", "nadir")),
        (("--search", "samples", "--memory", "other"), ("--memory other",)),
        (("--scene", "a.toml", "--tilt", "3"), ("--tilt", "scene")),
        (("--scene", "a.toml", "--no-noise"), ("--no-noise", "scene")),
        (("--scene", "missing.toml"), ("missing.toml", "No such file")),
        (("--mode", "lis"), ("--mode",)),
    ],
)
def test_wrong_calls_of_measure_cubesense(
    run: Run, arguments: tuple[str, ...], words: tuple[str, ...]
) -> None:
    check_one_line(run("measure", "cubesense", *arguments), *words)


@pytest.mark.parametrize("command", ["measure", "emulate"])
def test_a_scene_of_the_other_device_is_refused(run: Run, tmp_path: Path, command: str) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text('kind = "sky"\nra_deg = 1\ndec_deg = 1\n', encoding="utf-8")
    check_one_line(run(command, "cubesense", "--scene", scene), "scene.toml", "earth-sun", "sky")
    scene.write_text('kind = "earth-sun"\n', encoding="utf-8")
    check_one_line(run(command, "cubestar", "--scene", scene), "scene.toml", "sky", "earth-sun")
