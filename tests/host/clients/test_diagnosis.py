import re
import shutil
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.host.clients import diagnosis
from cubestack.host.clients.diagnosis import why_silent
from cubestack.host.devices.registry import device
from cubestack.host.emulation.process import emulating
from cubestack.host.errors import NoAnswerError
from cubestack.host.shell.language import Shell
from cubestack.host.targets import open_target
from cubestack.host.transport.streams import SerialTransport, open_transport
from tests.tiers import quick

from ..conftest import UartLink

INTERFACE = device("cubesense").interface
IDENTIFICATION = INTERFACE.telemetries[0]
SERVES = re.compile(r" serves on (\S+) at ")


@contextmanager
def answering(answer: Callable[[bytes], bytes]) -> Iterator[str]:
    """A TCP port that answers each request with ``answer(request)``."""

    def serve() -> None:
        client, _ = server.accept()
        with client:
            while data := client.recv(4096):
                client.sendall(answer(data))

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve)
        thread.start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"
        thread.join()


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (lambda _data: encode_frame(bytes(IDENTIFICATION.length)), ""),
        (lambda _data: b"", "no byte arrives: is it powered"),
        (lambda data: data, "only an echo comes back"),
        (lambda _data: encode_frame(b"abc"), "not as CubeSense does: is it another device? (61 "),
        (lambda _data: b"login: ", "bytes arrive, but no frame: .* (6c 6f 67 69 6e 3a 20)"),
    ],
)
def test_diagnosis_depends_on_the_received_bytes(
    answer: Callable[[bytes], bytes], told: str
) -> None:
    with answering(answer) as port:
        line = open_transport(port, INTERFACE.baud)
        found = why_silent(line, INTERFACE)
        line.close()
    assert re.search(re.escape(told).replace(r"\.\*", ".*"), found)
    assert bool(found) == bool(told)


def test_diagnosis_is_for_real_serial_lines_only(sense: object) -> None:
    assert why_silent(UartLink(sense), INTERFACE) == ""  # type: ignore[arg-type]


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
@pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")  # pyserial's
@pytest.mark.parametrize("how", quick(["--strict-line --pty", "--rfc2217 0"], 1))
def test_finds_the_baud_rate(how: str, tmp_path: Path) -> None:
    words = how.split() + ([str(tmp_path / "tty")] if "pty" in how else [])
    with emulating(["cubesense", "--baud", "38400", *words]) as said:
        served = next(found[1] for one in said if (found := SERVES.search(one)))
        target = open_target(served, "cubesense", baud=19200)
        shell = Shell(target)
        with pytest.raises(NoAnswerError, match="it answers at 38400 baud, and this is 19200"):
            shell.execute("read Identification")
        line = target.line
        assert isinstance(line, SerialTransport)
        assert line.baud == 19200
        with pytest.raises(NoAnswerError, match="38400"):  # known, without another look
            shell.execute("read Identification")
        line.set_baud(38400)
        assert shell.execute("read Identification")
        line.set_baud(19200)
        with pytest.raises(NoAnswerError) as lost:  # it was not the baud rate: it has answered
            shell.execute("read Identification")
        assert "baud" not in str(lost.value)
        target.close()


@pytest.mark.skipif(shutil.which("socat") is None, reason="no socat")
def test_open_cable_restores_the_baud_rate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnosis, "SILENCE_S", 0.02)
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    ends = [f"pty,raw,echo=0,link={end}" for end in (ours, theirs)]
    with subprocess.Popen(["socat", "-d", "-d", *ends], stderr=subprocess.PIPE) as cable:
        try:
            assert cable.stderr is not None
            assert any(b"data transfer loop" in line for line in cable.stderr)
            line = SerialTransport(str(ours), 57600)
            assert why_silent(line, INTERFACE).startswith("no byte arrives")
            assert line.baud == 57600
            line.close()
        finally:
            cable.terminate()
