import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.system.conftest import ROOT, Emulate

POINTING_RAD = (1.4661, -0.0175)  # right ascension 84, declination -1 degrees: what emulate shows
CRUX_RAD = (-3.0369, -1.0472)  # 186, in the range -pi to pi, and -60 degrees
CRUX = 'kind = "sky"\nra_deg = 186.0\ndec_deg = -60.0\nmag_limit = 3.8\n'

EXAMPLE = ROOT / "examples" / "plain_pyserial.py"


def run_python(*arguments: object, folder: Path) -> str:
    """Output of a Python program in a process of its own."""
    command = [sys.executable, *map(str, arguments)]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.mark.parametrize(
    ("options", "expected_rad"),
    [(("--tcp", "0"), POINTING_RAD), (("--pty", "port", "--scene", "crux.toml"), CRUX_RAD)],
)
def test_plain_pyserial_on_a_pseudo_terminal_and_over_tcp(
    emulate: Emulate, tmp_path: Path, options: tuple[str, ...], expected_rad: tuple[float, float]
) -> None:
    (tmp_path / "crux.toml").write_text(CRUX)
    with emulate(*options, "--pace", "fast") as served:
        target = served.port.replace("tcp://", "socket://")
        output = run_python(EXAMPLE, target, folder=tmp_path)
    found = re.search(r"right ascension (\S+) rad, declination (\S+) rad", output)
    assert found is not None, output
    angles = [float(angle) for angle in found.groups()]
    assert angles == pytest.approx(expected_rad, abs=3e-4)  # telemetry counts in steps of 1e-4
    assert served.process.returncode == 0


def test_example_is_short_and_uses_only_the_protocol() -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    assert "cubestack" not in text
    assert len(text.splitlines()) <= 40


def test_port_in_use_is_an_error(emulate: Emulate) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(AssertionError, match="choose another port"), emulate("--tcp", port):
            pass
