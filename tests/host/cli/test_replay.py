import argparse
import json

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.cubesense.state import CameraSettings
from cubestack.host.cli.device_options import inject_plan, record
from cubestack.host.emulation import history as past
from cubestack.host.emulation.emulated import open_device, power_up
from cubestack.host.output import Outputs
from cubestack.host.recording.setups import emulated_setup

HEADER = '{"recording":1,"device":"cubesense","lines":{}'

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "a.rec"
    args = argparse.Namespace(record=path, trace=tmp_path / "a.vcd")
    with open_device("cubesense", seed=3) as opened, Outputs() as stack:
        record(args, opened, stack, emulated_setup(3, None))
        client = opened.client.client
        client.telemetry("Configuration")
        client.command("DetectionThreshold1", Threshold=9)
        client.telemetry("Configuration")
    assert (tmp_path / "a.vcd").stat().st_size > 1000
    return path


def check_same(outcome):
    """The replay found no difference and printed no warning."""
    assert (outcome.code, outcome.err) == (0, "")
    assert "no difference" in outcome.out


def test_replay_of_a_recording_has_no_difference(recording, run, tmp_path):
    again = tmp_path / "b.rec"
    check_same(run("replay", recording, "--record", again))
    assert again.read_text() == recording.read_text()


def test_replay_reports_a_changed_default(recording, run, monkeypatch):
    reset = CameraSettings.at_reset

    def changed(camera):
        settings = reset(camera)
        settings.threshold += 1
        return settings

    monkeypatch.setattr(CameraSettings, "at_reset", changed)
    outcome = run("replay", recording, "--json")
    (difference,) = json.loads(outcome.out)["differences"]
    assert outcome.code == 1
    assert "telemetry Configuration, field Threshold1: 0xe2, recorded 0xe1" in difference


SUN = 'kind = "earth-sun"\nsun_deg = [{}, 10]\n'

SESSION = (
    "write CaptureAndDetect SUN SRAM1; time 0.5; read Result1; fault uart-drop rate=0.3 for_s=9;"
    "raw 1f7f801fff; raw 1f7f801fff; raw 1f7f801fff; raw 1f7f801fff; fault clear; power SRAM1 off;"
    "time 0.1; scene {}; power SRAM1 on; write CaptureAndDetect SUN SRAM1; time 0.5; read Result1"
)


@pytest.fixture
def session(tmp_path, run):
    """A session with faults and two scenes: recording, scene files, output."""
    scenes = [tmp_path / "first.toml", tmp_path / "second.toml"]
    for number, path in enumerate(scenes):
        path.write_text(SUN.format(10 * number))
    made = tmp_path / "session.rec"
    options = ["--scene", scenes[0], "--seed", "5", "--record", made]
    outcome = run("shell", "emulated:cubesense", *options, "-c", SESSION.format(scenes[1]))
    assert outcome.code == 0
    return made, scenes, outcome.out


def test_recording_stores_seed_scenes_faults_and_switches(session, run, tmp_path):
    made, scenes, said = session
    results = [line.split()[1:] for line in said.splitlines() if line.startswith("Alpha")]
    first, second = results
    assert first != second
    again = tmp_path / "again.rec"
    check_same(run("replay", made, "--record", again))
    assert again.read_text() == made.read_text()
    for scene in scenes:
        scene.unlink()
    check_same(run("replay", made))


@pytest.mark.parametrize(
    ("device", "commands"),
    [
        ("cubestar", "write CaptureAndProcess; read Quaternion; write 21 16 9; dump"),
        ("aramis", "write Activate; write GetAttitude; time 2; dump; fault memory-flip; dump"),
    ],
)
def test_recorded_session_of_each_device_replays_identically(tmp_path, run, device, commands):
    made = tmp_path / "session.rec"
    assert run("shell", f"emulated:{device}", "--record", made, "-c", commands).code == 0
    check_same(run("replay", made))


def test_recording_stores_the_profile_and_defaults_to_extended(tmp_path, run):
    made, header = (
        tmp_path / "session.rec",
        '"options":{"profile":"extended","set":"voting=confirmed"}',
    )
    said = ("--profile", "extended", "--set", "voting=confirmed", "--record", made)
    commands = "write CaptureAndProcess; read Quaternion; write Exposure 9; read DetectionSummary"
    assert run("shell", "emulated:cubestar", *said, "-c", commands).code == 0
    text = made.read_text()
    assert header in text
    check_same(run("replay", made))
    made.write_text(text.replace("," + header, ""))
    outcome = run("replay", made)
    assert (outcome.code, "no difference" in outcome.out) == (0, True)
    assert "namesnoprofile" in "".join(outcome.err.split())
    made.write_text(text.replace('"extended","set":"voting=confirmed"', '"published"'))
    assert run("replay", made).code == 1


def test_replay_reports_options_that_differ_from_the_recording(session, run, tmp_path):
    made, scenes, _ = session
    plan = tmp_path / "plan.toml"
    plan.write_text("seed = 1\n")
    outcome = run("replay", made, "--seed", "6", "--scene", scenes[1], "--faults", plan)
    assert (outcome.code, "field" in outcome.out) == (1, True)
    assert "".join(outcome.err.split()) == (
        "seed6insteadof5,withwhichitwasrecorded"
        f"scene{scenes[1]}isnotwhatitwasrecordedwith,{scenes[0]}"
        f"planoffaults{plan}:itwasrecordedwithoutone"
    )
    check_same(run("replay", made, "--seed", "5", "--scene", scenes[0]))


def test_plan_of_faults_and_options_are_in_the_header(tmp_path, run, monkeypatch):
    plan = tmp_path / "plan.toml"
    plan.write_text('seed = 9\n[[fault]]\nkind = "uart-drop"\nrate = 0.2\n')
    made = tmp_path / "a.rec"
    args = argparse.Namespace(record=made, trace=None)
    with open_device("cubesense", seed=3, baud=9600) as opened, Outputs() as stack:
        inject_plan(opened.board.faults, plan)
        setup = emulated_setup(3, None, plan, {"mcu_addressing": True})
        record(args, opened, stack, setup)
        line = opened.board.serial()
        for _ in range(20):
            line.write(b"\x1f\x7f\x80\x1f\xff")
            line.read(100, 0.1)
    plan.unlink()
    options = []

    def with_usual_fpgas(*arguments, mcu_addressing, **others):  # the others take long to compile
        options.append(mcu_addressing)
        return power_up(*arguments, **others)

    monkeypatch.setattr(past, "power_up", with_usual_fpgas)
    check_same(run("replay", made))
    assert options == [True]
    changed = made.read_text().replace("seed = 9", "seed = 8")
    made.write_text(changed)
    assert run("replay", made).code == 1
    made.write_text(changed.replace("mcu_addressing", "x"))
    outcome = run("replay", made)
    assert (outcome.code, "its setup has an unknown option 'x'" in outcome.line) == (2, True)


@pytest.mark.parametrize(
    ("content", "error"),
    [
        (HEADER + ',"setup":{"seed":-1}}', '"seed" must be a whole number from 0, not -1'),
        (HEADER + '}\n{"ps":1,"control":["fly"]}', "nothing does 'fly'"),
        ("nonsense", "is no recording: line 1"),
        ('{"recording":1,"device":"mars","lines":{}}', "no device 'mars'"),
        ('{"recording":1,"device":"cubestar","lines":{"bench_uart":1}}', "has port bench_uart"),
    ],
)
def test_rejects_invalid_recordings(tmp_path, run, content, error):
    path = tmp_path / "x.rec"
    path.write_text(content)
    outcome = run("replay", path)
    assert (outcome.code, error in outcome.line) == (2, True)


def test_reports_files_that_cannot_be_opened(recording, run):
    outcome = run("replay", "no.rec")
    assert (outcome.code, "no.rec" in outcome.line) == (1, True)
    outcome = run("replay", recording, "--trace", "no/folder/x.vcd")
    assert (outcome.code, "can not write no/folder/x.vcd" in outcome.line) == (2, True)


def test_replay_traces_a_time_span(recording, run, tmp_path):
    made = tmp_path / "span.vcd"
    assert run("replay", recording, "--trace", made, "--trace-to", "0.001").code == 0
    times = [int(line[1:]) for line in made.read_text().splitlines() if line.startswith("#")]
    assert max(times) == 1_000_000
    outcome = run("replay", recording, "--trace-from", "1")
    assert (outcome.code, "of --trace" in outcome.err) == (2, True)
    words = ("--trace", made, "--force", "--trace-from", "1", "--trace-to", "1")
    outcome = run("replay", recording, *words)
    assert "behind --trace-from" in outcome.err
