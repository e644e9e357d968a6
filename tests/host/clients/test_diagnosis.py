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
from cubestack.host.devices.registry import device, devices
from cubestack.host.emulation.process import emulating
from cubestack.host.errors import NoAnswerError, TargetError
from cubestack.host.shell.language import Shell
from cubestack.host.targets import open_target
from cubestack.host.transport.streams import SerialTransport, open_transport

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
@pytest.mark.slow
@pytest.mark.parametrize("how", ["--strict-line --pty", "--rfc2217 0"])
def test_finds_the_baud_rate(how: str, tmp_path: Path) -> None:
    words = how.split() + ([str(tmp_path / "tty")] if "pty" in how else [])
    with emulating(["cubesense", "--baud", "38400", *words]) as said:
        served = next(found[1] for one in said if (found := SERVES.search(one)))
        target = open_target(served, "cubesense", baud=19200)
        target.node._timeout_s = 0.5  # of silence, of which there is much
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


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="no /proc here")
def test_another_reader_of_the_port_is_named(tmp_path: Path) -> None:
    port = tmp_path / "port"
    port.write_text("")
    assert list(diagnosis._other_users(str(port))) == []
    with port.open() as opened, subprocess.Popen(["tail", "-f"], stdin=opened) as reader:
        try:
            assert list(diagnosis._other_users(str(port))) == [f"tail (process {reader.pid})"]
        finally:
            reader.terminate()


class Fickle:
    """A port of which ``answers`` says at which rate each request is answered."""

    def __init__(self, answers: Callable[[int, int], bool]) -> None:
        self.rate, self.asked, self._answers = 9600, 0, answers

    def ask(self) -> bytes:
        self.asked += 1
        node = encode_frame(bytes(IDENTIFICATION.length))
        return node if self._answers(self.asked, self.rate) else b""


@pytest.mark.parametrize(
    ("answers", "told"),
    [
        (lambda _n, rate: rate == 19200, "it answers at 19200 baud, and this is 9600"),
        (lambda n, _rate: n in (2, 3, 6), "it answers now and then"),
        (lambda n, _rate: n == 3, "it answers now and then"),
    ],
)
def test_rate_is_blamed_only_if_it_explains_every_answer(
    answers: Callable[[int, int], bool], told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    fickle = Fickle(answers)

    class Port(SerialTransport):
        def __init__(self) -> None:
            self.name = "a port"

        @property
        def baud(self) -> int:
            return fickle.rate

        def set_baud(self, baud: int) -> bool:
            fickle.rate = baud
            return True

    monkeypatch.setattr(diagnosis, "_ask", lambda _line, _interface: fickle.ask())
    assert why_silent(Port(), INTERFACE) == told
    assert fickle.rate == 9600


@pytest.mark.parametrize("name", ["cubestar", "aramis"])
def test_wrong_device_is_recognised_by_its_node_type(name: str) -> None:
    wanted = device(name)
    values = IDENTIFICATION.reset_values() | {"NodeType": INTERFACE.node_type}
    with (
        answering(lambda _data: encode_frame(IDENTIFICATION.pack(**values))) as port,
        pytest.raises(TargetError, match=rf"node type 4 is a CubeSense, not an? {wanted.title};"),
    ):
        open_target(port, name)


def test_device_with_an_unknown_node_type_is_accepted() -> None:
    values = IDENTIFICATION.reset_values() | {"NodeType": 99}
    with answering(lambda _data: encode_frame(IDENTIFICATION.pack(**values))) as port:
        open_target(port, "cubestar").close()


def test_firmware_with_another_interface_is_used_with_a_warning() -> None:
    interface = device("cubestar").interface
    own = {"NodeType": diagnosis.node_type_of(interface)}
    values = IDENTIFICATION.reset_values() | own | {"InterfaceVersion": interface.version + 1}
    with answering(lambda _data: encode_frame(IDENTIFICATION.pack(**values))) as port:
        with pytest.warns(UserWarning, match=r"has version 4, this program reads 3; update cube"):
            open_target(port, "cubestar").close()
        known = values | {"InterfaceVersion": interface.version}
    with answering(lambda _data: encode_frame(IDENTIFICATION.pack(**known))) as port:
        open_target(port, "cubestar").close()


def test_each_device_has_a_node_type_of_its_own() -> None:
    types = [diagnosis.node_type_of(one.interface) for one in devices()]
    assert len({*types}) == len(types)
    assert 0 not in types
