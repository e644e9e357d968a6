import contextlib
import io
import json
import os
import pty
import re
import select
import subprocess
import sys
from functools import partial

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.cubesense.codes import ImageSize
from cubestack.host.cli.main import main
from cubestack.host.clients.cubesense import client
from cubestack.host.clients.cubesense.download import download_image
from tests.forked import Served
from tests.tiers import quick_ones

TIMEOUT_S = 60

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
    # pyserial's RFC 2217
    pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning"),
]


@pytest.fixture
def shell(run):
    return partial(run, "shell")


def test_shell_commands_run_on_emulated_cubesense(shell):
    commands = (
        "write CaptureAndDetect SUN SRAM1; time 0.5; read Result1 Detect; bench q;"
        "write SUN_THRESHOLD 30; read SUN_THRESHOLD; fault latch-up SRAM2; time 0.1;"
        "fault uart-drop rate=0.5 for_s=1; fault clear;"
        "read Power OverCurrent2"
    )
    code, out, err = shell("emulated:cubesense", "--json", "-c", commands)
    assert (code, err) == (0, "")
    results = [json.loads(line) for line in out.splitlines()]
    assert results[2]["values"] == {"Detect": 7}
    assert bytes.fromhex(results[3]["answer"]) == b"Y"
    assert results[5]["values"] == {"SUN_THRESHOLD": 30}
    assert results[-1]["values"] == {"OverCurrent2": 1}


def test_shell_runs_a_script_on_emulated_cubestar(shell, tmp_path):
    script = tmp_path / "commands.txt"
    script.write_text("# comment\n\nread Identification NodeType\nquit\nread nonsense\n")
    assert shell("emulated:cubestar", "--script", str(script)) == (0, "NodeType  5\n", "")


@pytest.mark.parametrize(
    ("arguments", "code", "error"),
    [
        (["emulated:cubesense", "-c", "read nothing"], 2, "nothing is called 'nothing'"),
        (["emulated:cubesense", "-c", "write Reset 9"], 1, "refused: BAD_PARAMETER (3)"),
        (["emulated:cubestar", "-c", "read CameraSetup"], 1, "CameraSetup is not supported"),
        (["emulated:mars", "-c", ""], 2, "no device 'mars' can be emulated"),
        (["emulated:cubesense", "--bench", "x", "-c", ""], 2, "leave out --bench"),
        (["./port", "-c", "", "--scene", "x"], 2, "--scene is for emulated:DEVICE"),
        (["./port", "--script", "no.txt"], 2, "can not read script no.txt"),
        (["./port", "--device", "cubestar", "-c", ""], 1, "can not open ./port"),
        (["emulated:cubesense", "-c", "scene no.toml"], 2, "no.toml"),
        (["emulated:cubesense", "-c", "fault meteor"], 2, "meteor"),
        (["emulated:cubesense", "-c", "fault uart-drop rate=7"], 2, "rate"),
        (["emulated:cubesense", "-c", "fault uart-drop x y"], 2, "one target, not x y"),
        (["emulated:cubesense", "-c", "fault uart-drop for_s=long"], 2, "not 'long'"),
        (["emulated:cubesense", "-c", "fault uart-drop fault=x"], 2, "unknown parameter 'fault'"),
    ],
)
def test_failure_prints_one_line(shell, arguments, code, error):
    outcome = shell(*arguments)
    assert outcome.code == code
    assert error in outcome.line


def test_image_reports_an_over_current_of_its_memory(shell, tmp_path, monkeypatch):
    # Whole pictures have 2176 chunks of margin before the first that is read from the memory.
    small = partial(download_image, size=ImageSize.SIDE_64)
    monkeypatch.setattr(client, "download_image", lambda node, sram, *_: small(node, sram))
    commands = (
        "write CaptureOnly SUN SRAM1 TOP; time 1; fault latch-up SRAM1;"
        f"image '{tmp_path / 'x.png'}'"
    )
    code, _, err = shell("emulated:cubesense", "-c", commands)
    assert code == 1
    assert "SRAM1 drew too much current" in err


def test_shell_runs_interactively_on_a_terminal(tmp_path):
    master, slave = pty.openpty()
    environment = os.environ | {"XDG_STATE_HOME": str(tmp_path), "TERM": "dumb"}
    command = [sys.executable, "-m", "cubestack.host.cli.main", "shell", "emulated:cubesense"]
    process = subprocess.Popen(
        command, stdin=slave, stdout=slave, stderr=slave, env=environment, start_new_session=True
    )
    os.close(slave)
    seen = b""

    def expect(text: bytes) -> None:
        nonlocal seen
        while text not in seen:
            assert select.select([master], [], [], TIMEOUT_S)[0], seen
            seen += os.read(master, 4096)
        seen = seen[seen.index(text) + len(text) :]

    try:
        expect(b"cubesense> ")
        os.write(master, b"read Ident\t NodeT\t\n")
        expect(b"NodeType  4")
        expect(b"cubesense> ")
        os.write(master, b"raed\n")
        expect(b"did you mean read?")
        expect(b"cubesense> ")
        os.write(master, b"quit\n")
        assert process.wait(TIMEOUT_S) == 0
    finally:
        process.kill()
        process.wait()
        os.close(master)
    history = (tmp_path / "cubestack" / "history").read_text()
    assert "read Identification" in history


# --- every kind of target -------------------------------------------------------------------------

BUS = 16 + os.getpid() % 200
COMMANDS = (
    "read 128 NodeType; write DetectionThreshold1 77; read Configuration Threshold1;"
    "write 41 Threshold=78; read Configuration;"
    "watch Configuration 2 0.01; list 41; read 250"
)
SAID = ("NodeType  4", "Threshold1  77", "Threshold2   78 DN", "DetectionThreshold2: done")
KINDS = ("pty", "tcp", "rfc2217", "i2c")


@contextlib.contextmanager
def serving(kind, folder):
    """Serves a CubeSense on a port of ``kind``; yields the target that opens it."""
    given = {"pty": ["--pty", str(folder / "tty")], "i2c": ["--i2c", str(BUS), "--tcp", "0"]}
    words = ["cubesense", "--pace", "fast", *given.get(kind, [f"--{kind}", "0"])]
    with Served(words, folder, last="CubeSense serves on ") as served:
        line = served.said.splitlines()[-1]
        yield f"i2c:{BUS}:0x1b" if kind == "i2c" else line.split()[3]


@pytest.fixture(scope="module")
def emulated():
    """Result of the commands on a device in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(["shell", "emulated:cubesense", "-c", COMMANDS])
    errors = err.getvalue().splitlines(keepends=True)
    return code, out.getvalue(), "".join(one for one in errors if not one.startswith("opening "))


def test_emulated_device_runs_the_commands(emulated):
    code, out, err = emulated
    assert code == 2
    for text in SAID:
        assert text in out
    assert "near: " in err


@pytest.mark.parametrize("kind", quick_ones(KINDS, "tcp"))
def test_every_kind_of_target_and_its_recording_give_the_same_output(
    run, emulated, tmp_path, monkeypatch, kind
):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    made = tmp_path / "session.rec"
    with serving(kind, tmp_path) as target:
        live = run("shell", target, "--device", "cubesense", "-c", COMMANDS, "--record", made)
    assert load_recording(made).setup.target == target
    recorded = run("shell", f"recorded:{made}", "-c", COMMANDS)
    assert without_times(live) == without_times(recorded) == without_times(emulated)


def without_times(outcome: tuple[int, str, str]) -> tuple[int, str, str]:
    """Without the times of ``watch``, which are those of the target."""
    code, out, err = outcome
    return code, re.sub(r"^after [\d.]+ s$", "after", out, flags=re.MULTILINE), err
