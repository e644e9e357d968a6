"""The example clients of the bus's socket, without a device file."""

import re
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tests.system.conftest import ROOT

from ...conftest import Outcome
from .conftest import TIMEOUT_S, find_c_compiler, needs_c

EXAMPLES = ROOT / "examples" / "i2c_socket"

TARGETS = "cubestar 0x1a\nlatch 0x50\n"


@pytest.fixture(scope="module", params=["c", "python"])
def client(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The command that runs it."""
    if request.param == "python":
        return [sys.executable, "-I", "-S", str(EXAMPLES / "i2c_socket.py")]
    compiler = find_c_compiler()
    if compiler is None:
        pytest.skip("no C compiler here")
    program = tmp_path_factory.mktemp("client") / "identify"
    sources = [EXAMPLES / "identify.c", EXAMPLES / "i2c_socket.c"]
    options = ["-std=c99", "-D_GNU_SOURCE", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run([*compiler, *options, *sources, "-o", program], check=True)
    return [str(program)]


def run(*words: object) -> Outcome:
    done = subprocess.run(
        [str(word) for word in words], capture_output=True, text=True, timeout=TIMEOUT_S
    )
    return Outcome(done.returncode, done.stdout, done.stderr)


def test_client_lists_devices_and_reads_one(client: list[str], served: Path) -> None:
    assert run(*client, served, "0x1a") == (0, f"{TARGETS}5 3 0 1\n", "")


def test_client_reports_an_address_without_a_device(client: list[str], served: Path) -> None:
    outcome = run(*client, served, "0x33")
    assert (outcome.code, outcome.out) == (1, TARGETS)
    assert outcome.err.endswith("No such device or address\n")


def test_client_reports_a_missing_emulation(client: list[str], tmp_path: Path) -> None:
    outcome = run(*client, tmp_path / "bus", "0x1a")
    assert (outcome.code, outcome.out) == (1, "")
    assert outcome.err.endswith("No such file or directory\n")


def test_client_reports_an_emulation_that_ends(client: list[str], tmp_path: Path) -> None:
    path = tmp_path / "bus"
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(path))
        listening.listen()

        def end() -> None:
            with listening.accept()[0] as connection:
                connection.recv(100)

        ending = threading.Thread(target=end)
        ending.start()
        outcome = run(*client, path, "0x1a")
        ending.join()
    assert (outcome.code, outcome.out) == (1, "")
    assert re.search("Input/output error|the emulation has ended", outcome.err)


@needs_c
def test_client_of_another_version_is_refused_in_words(served: Path, tmp_path: Path) -> None:
    compiler = find_c_compiler()
    assert compiler is not None
    text = (EXAMPLES / "i2c_socket.c").read_text()
    (tmp_path / "i2c_socket.c").write_text(text.replace("VERSION = 1", "VERSION = 9"))
    sources = [EXAMPLES / "identify.c", tmp_path / "i2c_socket.c"]
    program = tmp_path / "identify"
    subprocess.run([*compiler, f"-I{EXAMPLES}", *sources, "-o", program], check=True)
    words = "this emulation speaks version 1 of the protocol, not 9"
    assert run(program, served, "0x1a").err == f"identify: {served}: {words}\n"
