"""Libraries and languages on each kind of serial port: the table of docs/how-to/serial-ports.md."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.system.clients import (
    ENVIRONMENT,
    Client,
    Command,
    built,
    interpreter,
    node,
    python,
    table,
    tool,
)
from tests.system.conftest import ROOT, Served

PROGRAMS = Path(__file__).with_name("programs")
KINDS = ("pty", "tcp", "rfc2217")
TIMEOUT_S = 60

FILES_ONLY = (("tcp", "opens files only"), ("rfc2217", "opens files only"))
NO_TELNET = (("rfc2217", "has no telnet"),)


def with_tool(name: str, *words: str) -> Command:
    """Python with pyserial, for a program that runs another one."""

    def command(source: Path, folder: Path) -> list[str | Path]:
        tool(name)
        return python("serial", *words)(source, folder)

    return command


CLIENTS = (
    Client("Python pyserial 3.5", "pyserial_client.py", python("serial")),
    Client("Python serialx 1.15", "serialx_client.py", python("serialx")),
    Client("python-periphery 2.4", "periphery_serial.py", python("periphery"), FILES_ONLY),
    Client("npm serialport 13.0 (Node.js 20)", "serialport.js", node("serialport"), FILES_ONLY),
    Client("ser2net 4.3", "ser2net.py", with_tool("ser2net")),
    Client("gensiot 2.6", "gensio.py", with_tool("gensiot")),
    Client("socat 1.7", "socat.sh", interpreter("sh"), NO_TELNET),
    Client("C, termios and sockets", "termios.c", built("cc", "-D_DEFAULT_SOURCE"), NO_TELNET),
    Client("Perl 5.36 without modules", "plain.pl", interpreter("perl"), NO_TELNET),
    Client("Rust 1.95", "plain.rs", built("rustc"), NO_TELNET),
    Client("Go 1.19", "plain.go", built("go", "build"), NO_TELNET),
)


@pytest.fixture(scope="module", params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def port(kind: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Path, or host and port, of a CubeStar."""
    folder = tmp_path_factory.mktemp("port")
    with Served(["cubestar", f"--{kind}", "./tty" if kind == "pty" else "0"], folder) as served:
        yield str(folder / "tty") if kind == "pty" else served.port.split("//")[1]


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Each program is built there once."""
    return tmp_path_factory.mktemp("clients")


@pytest.mark.slow
@pytest.mark.parametrize("client", CLIENTS, ids=lambda client: client.name)
def test_program_reads_telemetry_from_each_kind_of_port(
    client: Client, kind: str, port: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CGO_ENABLED", "0")
    if client.source == "socat.sh":
        tool("socat")
    command = client.command(PROGRAMS / client.source, folder / client.name)
    done = subprocess.run(
        [*command, kind, port],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        env=os.environ | ENVIRONMENT,
        start_new_session=True,  # some programs end all of theirs
    )
    if client.reason(kind):
        assert "05030001" not in done.stdout
    else:
        assert done.stdout == "05030001\n", done.stderr


def test_page_has_the_table_of_clients() -> None:
    page = (ROOT / "docs" / "how-to" / "serial-ports.md").read_text(encoding="utf-8")
    source = "<!-- table: generated from tests/system/serial_programs/test_clients.py -->\n"
    assert page.split(source)[1].split("\n<!-- end of table -->")[0] == table(CLIENTS, KINDS)
