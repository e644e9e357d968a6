"""`cubestack ground`: what can not be opened is one line, and nothing is left behind."""

import subprocess
import sys

import pytest

from cubestack.host.cli.main import main


def test_a_device_that_there_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ground", "emulated:nothing"]) == 2
    assert "no device 'nothing' can be emulated; known: emulated:" in capsys.readouterr().err


def test_a_port_that_there_is_not() -> None:
    call = [sys.executable, "-m", "cubestack", "ground", "/dev/nothing", "--device", "cubestar"]
    ended = subprocess.run(call, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 1
    (line,) = ended.stderr.splitlines()
    assert "/dev/nothing" in line
