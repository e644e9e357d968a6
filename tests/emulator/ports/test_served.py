"""The ports served by the scheduler in a thread, for programs that know nothing of us."""

import contextlib
import os
import shutil
import subprocess
from pathlib import Path

import pytest
import serial

from .conftest import ALL_BYTES, TIMEOUT_S, open_client, served

# pyserial calls setDaemon and setName of a thread.
pytestmark = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")

MESSAGE = bytes(byte for byte in range(256) if byte not in (0x01, 0x0A, 0x0D))
"""Without picocom's escape (C-a) and line ends."""

a_pty = pytest.mark.parametrize("kind", ["pty"])


@pytest.mark.parametrize("pace", ["real", "fast"])
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("pty", {"baudrate": 57_600, "exclusive": True}),
        ("tcp", {}),
        ("rfc2217", {"baudrate": 1_000_000}),
    ],
)
def test_pyserial(port, device, pace, options):
    device.answers = 1
    url = port.name.replace("tcp:", "socket:")
    with served(device, port, pace):
        for round_ in range(3):
            with serial.serial_for_url(url, timeout=TIMEOUT_S, **options) as client:
                message = ALL_BYTES + bytes([round_])
                client.write(message)
                assert client.read(len(message)) == message


@a_pty
@pytest.mark.parametrize("pace", ["real", "fast"])
def test_plain_file_on_a_pty(port, device, pace):
    device.answers = 1
    with served(device, port, pace), contextlib.closing(open_client(port)) as terminal:
        terminal.write(ALL_BYTES)
        assert terminal.read(256) == ALL_BYTES


def test_fast_pace_loses_no_bytes_to_a_slow_client(port, device):
    """Virtual time waits for it: 400 kB come while it reads a few bytes at a time."""
    sent = bytes(i * 37 % 251 for i in range(400_000))
    device.uart.on_byte = lambda _byte: device.uart.send(sent)
    with served(device, port, "fast"), contextlib.closing(open_client(port)) as client:
        client.write(b"?")
        assert client.read(len(sent)) == sent


def needs(program: str) -> pytest.MarkDecorator:
    missing = shutil.which(program) is None
    return pytest.mark.skipif(missing, reason=f"{program} is not installed")


def run(*command: str, stdin: bytes = b"") -> bytes:
    done = subprocess.run(command, input=stdin, capture_output=True, timeout=TIMEOUT_S)
    assert done.returncode == 0, done.stderr
    return done.stdout


@needs("socat")
def test_socat(kind, port, device, path):
    device.answers = 1
    address = f"{path},raw,echo=0" if kind == "pty" else "TCP:{}:{}".format(*port.address)
    with served(device, port, "fast"):
        assert run("socat", "-t0.3", "-", address, stdin=MESSAGE) == MESSAGE


@needs("picocom")
@a_pty
def test_picocom(port, device, path):
    device.answers = 1
    command = ["picocom", "-q", "-b", "115200", "--nolock", "--exit-after", "300", str(path)]
    with served(device, port, "fast"):
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


@a_pty
def test_c_program_with_termios(port, device, path, c_client):
    device.answers = 1
    with served(device, port, "fast"):
        for _ in range(3):
            assert run(str(c_client), str(path)) == b"echoed\n"


@a_pty
def test_plain_shell(port, device, path):
    device.answers = 1
    with served(device, port, "fast"):
        script = f"exec 3<>{path}; printf 'hello' >&3; head -c 5 <&3"
        assert run("sh", "-c", script) == b"hello"
