import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.cli import commands as registry
from cubestack.host.cli.commands import commands, reports
from cubestack.host.cli.export import OF_INTERFACE, OF_PROCESSOR
from cubestack.host.cli.measure import _are_right
from cubestack.host.devices.experiment import Result
from cubestack.host.devices.registry import devices
from cubestack.host.studies.cubestar.demo import RENDERED

from ...conftest import Outcome, Run

DONE, FAILED, WRONG_CALL = 0, 1, 2
NEEDS_COMPILER = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


def check_one_line(outcome: Outcome, *words: str) -> None:
    assert outcome.code == WRONG_CALL
    for word in words:
        assert word in outcome.line


def dark_picture(path: Path, size: tuple[int, int] = (1024, 512)) -> Path:
    Image.fromarray(np.zeros(size[::-1], np.uint8)).save(path)
    return path


def test_command_imports_only_its_own_module(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = list[str]()
    load = registry.import_module
    monkeypatch.setattr(registry, "import_module", lambda name: loaded.append(name) or load(name))
    assert run("-q", "registers", "cubestar").code == DONE
    assert loaded == ["cubestack.host.cli.registers"]
    assert run("--help").code == DONE
    assert len(loaded) == 1, "the list of commands loads none"


@pytest.mark.parametrize("words", ["--help", "registers cubestar", "shell --help", "nonsense"])
def test_command_without_emulation_imports_no_emulator(words: str) -> None:
    script = (
        "import sys; from cubestack.host.cli.main import main\n"
        "try: main(sys.argv[1:])\nexcept SystemExit: pass\n"
        "heavy = 'cubestack.emulator', 'amaranth'\n"
        "found = [name for name in sys.modules if name.startswith(heavy)]\n"
        "sys.exit(str(found) if found else 0)"
    )
    done = subprocess.run([sys.executable, "-c", script, *words.split()], capture_output=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("command", [None, *commands(), *reports()])
def test_help_exits_with_0_and_links_to_the_documents_it_names(
    run: Run, command: str | None
) -> None:
    outcome = run(*([command] if command else []), "--help")
    assert outcome.code == DONE
    assert outcome.out.startswith("usage: cubestack")
    assert outcome.err == ""
    assert ("docs/" in outcome.out) == ("\ndocs/: https://" in outcome.out)
    assert "docs/" in outcome.out or command != "emulate"


@pytest.mark.parametrize(
    ("device", "text", "words"),
    [
        ("cubestar", "kind = sky", ["not a TOML file"]),
        ("cubestar", 'kind = "picture"\nfile = "none.png"', ["none.png"]),
        ("cubestar", 'kind = "earth-sun"\n', ["sky", "earth-sun"]),
        ("cubesense", 'kind = "sky"\nra_deg = 1\ndec_deg = 1\n', ["earth-sun", "sky"]),
    ],
)
@pytest.mark.parametrize("command", ["measure", "emulate"])
def test_rejects_invalid_scene_files(
    run: Run, tmp_path: Path, command: str, device: str, text: str, words: list[str]
) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(text, encoding="utf-8")
    check_one_line(run(command, device, "--scene", scene), "scene.toml", *words)


@pytest.mark.parametrize(
    ("size", "crop", "words"),
    [
        ((640, 480), "0,0", ("640 x 480", "1024 x 512")),
        ((1024, 1024), "0,600", ("1024 x 1024", "1024 x 1112")),
        ((1024, 512), "1,0", ("1025 x 512",)),
    ],
)
def test_rejects_images_smaller_than_the_frame(
    run: Run, tmp_path: Path, size: tuple[int, int], crop: str, words: tuple[str, ...]
) -> None:
    picture = dark_picture(tmp_path / "sky.png", size)
    check_one_line(run("measure", "cubestar", "--image", picture, "--crop", crop), *words)


def test_rejects_other_image_formats(run: Run, tmp_path: Path) -> None:
    picture = dark_picture(tmp_path / "sky.gif")
    words = "sky.gif is not a picture that is accepted", "PNG, JPEG, TIFF"
    check_one_line(run("measure", "cubestar", "--image", picture), *words)
    picture.write_text("stars")
    check_one_line(run("measure", "cubestar", "--image", picture), *words)


def test_lack_of_memory_is_one_line(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def exhaust(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("cubestack.host.cli.measure.run_experiment", exhaust)
    done = run("measure", "cubestar")
    assert (done.code, done.line) == (
        FAILED,
        "cubestack measure: there is not enough memory for this",
    )


def test_camera_file_is_checked_and_without_the_picture_has_no_truth(
    run: Run, tmp_path: Path
) -> None:
    picture, camera = dark_picture(tmp_path / "sky.png"), tmp_path / "camera.json"
    camera.write_text("{}", encoding="utf-8")
    outcome = run("measure", "cubestar", "--image", picture, "--camera", camera)
    check_one_line(outcome, "camera.json", "f_px")
    camera.write_text('{"f_px": 1071, "cx_px": 512, "cy_px": 256}', encoding="utf-8")
    outcome = run("measure", "cubestar", "--image", picture, "--camera", camera, "--json")
    assert outcome.code == FAILED  # the picture is black
    assert json.loads(outcome.out)["truth"] is None


def test_compiled_engine_needs_a_compiler(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cubestack.emulator.native.compiler.find_compiler", lambda: None)
    outcome = run("measure", "cubestar", "--engine", "compiled")
    assert outcome.code == FAILED
    assert "no C++ compiler" in outcome.line


def test_shipped_image_has_an_absolute_path() -> None:
    for path in (RENDERED, RENDERED.with_suffix(".json")):
        assert path.is_absolute()
        assert path.is_file()


def test_rejects_pty_paths_that_exist_or_have_no_folder(run: Run, tmp_path: Path) -> None:
    taken = tmp_path / "ttyCUBESTAR"
    taken.write_text("a file of the user's", encoding="utf-8")
    outcome = run("emulate", "cubestar", "--pty", taken)
    assert outcome.code in (FAILED, WRONG_CALL)
    assert "ttyCUBESTAR' already exists" in outcome.line
    assert "choose another" in outcome.line
    assert taken.read_text(encoding="utf-8") == "a file of the user's"
    outcome = run("emulate", "cubestar", "--pty", tmp_path / "nowhere" / "tty")
    assert outcome.code in (FAILED, WRONG_CALL)
    assert "nowhere" in outcome.line
    assert not os.path.lexists(tmp_path / "nowhere")


@pytest.mark.parametrize(("limit_deg", "published"), [(42.101, 11_484), (42.105, 11_486)])
def test_catalogue_command_prints_json(run: Run, limit_deg: float, published: int) -> None:
    outcome = run("catalogue", "--pair-limit", limit_deg, "--json")
    assert (outcome.code, outcome.err) == (DONE, "")
    facts: dict[str, Any] = json.loads(outcome.out)
    assert (facts["stars"], facts["pairs"]) == (405, published)
    assert np.round(facts["closest_pairs_rad"], 4).tolist() == [0.0017, 0.0067]


def test_memory_report_names_every_buffer_and_fits(run: Run) -> None:
    outcome = run("memory", "cubesense", "--json")
    assert outcome.code == DONE
    ram = json.loads(outcome.out)["RAM"]
    assert ram["used"] <= ram["bytes"] == 1536
    assert {"Sun window", "edges", "software stack"} <= ram["buffers"].keys()
    table = run("memory", "cubesense")
    assert all(name in table.out for name in ram["buffers"])


@pytest.mark.parametrize("form", [*OF_INTERFACE, *OF_PROCESSOR])
def test_out_writes_the_printed_text(form: str, run: Run, tmp_path: Path) -> None:
    for device in devices():
        printed = run("export", device.name, "--format", form)
        if form in OF_PROCESSOR and device.processor is None:
            assert (printed.code, printed.line) == (
                2,
                f"cubestack export: the processor of {device.name} runs no firmware of your own",
            )
            continue
        assert (printed.code, printed.err) == (0, "")
        path = tmp_path / f"{device.name}.{form}"
        assert run("export", device.name, "--format", form, "--out", path) == (0, "", "")
        assert path.read_text(encoding="utf-8") == printed.out


@dataclass(frozen=True)
class Judged(Result):
    right: bool | None


@pytest.mark.parametrize(
    ("verdicts", "least", "said"),
    [
        ([True] * 9 + [False], 90, ""),
        ([True] * 9 + [False], 90.5, "90.0 % of 10 right; --min-right wants 90.5 %\n"),
        (
            [True, None],
            60,
            "50.0 % of 2 right, of 1 the truth is not known; --min-right wants 60 %\n",
        ),
        ([None, False], 0, ""),
    ],
)
def test_min_right_compares_the_share_of_right_results(
    capsys: pytest.CaptureFixture[str], verdicts: list[bool | None], least: float, said: str
) -> None:
    assert _are_right([Judged(verdict) for verdict in verdicts], least) is (not said)
    assert capsys.readouterr().err == said


@NEEDS_COMPILER
def test_measure_exit_status_follows_min_right(run: Run) -> None:
    call = ["measure", "cubestar", "--threshold", "250", "--frames", "2"]
    outcome = run(*call, "--min-right", "50", "--json")
    assert (outcome.code, outcome.err) == (FAILED, "0.0 % of 2 right; --min-right wants 50 %\n")
    assert len(outcome.out.splitlines()) == 2
    outcome = run(*call, "--min-right", "0")
    assert outcome.code == DONE
    assert "what may help: 0 stars found: --threshold below 250" in outcome.out
    outcome = run(*call)
    assert outcome.code == FAILED  # nothing at all was measured
    assert "of 2: 0.0 % solved" in outcome.out
    check_one_line(run(*call, "--min-right", "101"), "must be 0 to 100, not 101")


LATCH_UP = "[[fault]]\nkind = 'latch-up'\nat_s = 0.3\n"


@NEEDS_COMPILER
def test_measure_applies_the_fault_plan(run: Run, tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(LATCH_UP + "target = 'imager'\n")
    call = ["measure", "cubestar", "--mag-limit", "3.8", "--frames", "2", "--json"]
    outcome = run(*call, "--faults", plan)
    assert outcome.code == DONE
    first, second = [json.loads(line)["status"] for line in outcome.out.splitlines()]
    assert first.startswith("capture_failed OverCurrent")
    assert second == "calculated"


@NEEDS_COMPILER
@pytest.mark.parametrize(
    ("text", "message"),
    [
        (LATCH_UP + "target = 'radio'\n", "fault 1: latch-up: unknown supply channel 'radio'; "),
        ("[[fault]]\nkind = 'smoke'\n", "fault 1: unknown fault 'smoke'; known: uart-drop"),
    ],
)
def test_rejects_invalid_fault_plans(run: Run, tmp_path: Path, text: str, message: str) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(text)
    outcome = run("measure", "cubesense", "--frames", "1", "--faults", plan)
    assert outcome.code == WRONG_CALL
    assert outcome.err.splitlines()[-1].startswith(f"cubestack measure: {plan}: {message}")


def loudness(*words: str) -> str:
    call = [sys.executable, "-m", "cubestack", *words, "measure", "cubesense", "--frames", "1"]
    done = subprocess.run(call, capture_output=True, text=True, check=True)
    assert "wall time" in done.stdout
    return done.stderr


@pytest.mark.slow
@NEEDS_COMPILER
def test_verbose_logs_loaded_libraries_and_quiet_logs_nothing() -> None:
    assert "INFO cubestack.emulator.native.cache: loading " in loudness("-v")
    assert loudness("--quiet") == ""
    assert "INFO" not in loudness()
