"""`cubestack ground`: what can not be opened is one line, and nothing is left behind."""

import subprocess
import sys

import pytest

from cubestack.host.cli.main import main
from cubestack.host.extras import install_command
from tests.tiers import quick

CONTROLLED = ["emulate", "cubestar", "--tcp", "0", "--control", "0"]


def test_a_device_that_there_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ground", "emulated:nothing"]) == 2
    assert "no device 'nothing' can be emulated; known: emulated:" in capsys.readouterr().err


def test_options_are_for_what_is_emulated(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["ground", "/dev/nothing", "--device", "cubestar", "--profile", "extended"]
    assert main(words) == 2
    assert "--profile extended is for emulated:DEVICE" in capsys.readouterr().err


def test_an_emulation_that_does_not_start_is_told() -> None:
    call = [sys.executable, "-m", "cubestack", "ground", "emulated:cubestar"]
    call += ["--scene", "/none.toml"]
    ended = subprocess.run(call, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 1
    assert "/none.toml" in ended.stderr


def test_a_port_that_there_is_not() -> None:
    call = [sys.executable, "-m", "cubestack", "ground", "/dev/nothing", "--device", "cubestar"]
    ended = subprocess.run(call, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 1
    (line,) = ended.stderr.splitlines()
    assert "/dev/nothing" in line


@pytest.mark.parametrize("missing", quick(["starlette", "uvicorn", "websockets"], 1))
@pytest.mark.parametrize("words", [["ground", "emulated:cubestar"], CONTROLLED])
def test_what_must_be_installed_is_told(words: list[str], missing: str) -> None:
    text = (
        f"import sys; sys.modules['{missing}'] = None; from cubestack.host.cli.main import main; "
        f"sys.exit(main({words}))"
    )
    call = [sys.executable, "-c", text]
    ended = subprocess.run(call, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 2
    assert ended.stderr.endswith(f"this needs {missing}: {install_command('ground')}\n")
