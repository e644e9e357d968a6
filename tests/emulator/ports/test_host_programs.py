"""Programs that know nothing of us, on the ports that the scheduler serves."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

TIMEOUT_S = 20.0
MESSAGE = bytes(byte for byte in range(256) if byte not in (0x01, 0x0A, 0x0D))
"""Without picocom's escape (C-a) and line ends."""


def needs(program: str) -> pytest.MarkDecorator:
    missing = shutil.which(program) is None
    return pytest.mark.skipif(missing, reason=f"{program} is not installed")


def run(*command: str, stdin: bytes = b"") -> bytes:
    done = subprocess.run(command, input=stdin, capture_output=True, timeout=TIMEOUT_S)
    assert done.returncode == 0, done.stderr
    return done.stdout


@needs("socat")
@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_socat(kind, request, device, path, served):
    port = request.getfixturevalue(kind)
    device.echoes = True
    address = f"{path},raw,echo=0" if kind == "pty" else "TCP:{}:{}".format(*port.address)
    with served(device, port, "fast"):
        assert run("socat", "-t0.3", "-", address, stdin=MESSAGE) == MESSAGE


@needs("picocom")
def test_picocom(pty, device, path, served):
    device.echoes = True
    command = ["picocom", "-q", "-b", "115200", "--nolock", "--exit-after", "300", str(path)]
    with served(device, pty, "fast"):
        assert MESSAGE in run(*command, stdin=MESSAGE)


@pytest.fixture
def c_client(tmp_path) -> Path:
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    program = tmp_path / "termios_client"
    source = Path(__file__).parent / "termios_client.c"
    run(*compiler.split(), "-Wall", "-Werror", "-o", str(program), str(source))
    return program


def test_c_program_with_termios(pty, device, path, served, c_client):
    device.echoes = True
    with served(device, pty, "fast"):
        for _ in range(3):
            assert run(str(c_client), str(path)) == b"echoed\n"


def test_plain_shell(pty, device, path, served):
    device.echoes = True
    with served(device, pty, "fast"):
        script = f"exec 3<>{path}; printf 'hello' >&3; head -c 5 <&3"
        assert run("sh", "-c", script) == b"hello"
