import os
import socket
import tty
from collections.abc import Iterator
from io import FileIO
from typing import Any

import pytest
import serial

from cubestack.host.errors import PortClosedError, TargetError
from cubestack.host.transport import streams
from cubestack.host.transport.streams import SerialTransport, Transport, open_transport, read_answer

#: A line, and its far end.
Ends = tuple[Transport, FileIO]


@pytest.fixture
def serial_line() -> Iterator[Ends]:
    master, slave = os.openpty()
    tty.setraw(slave)
    transport = open_transport(os.ttyname(slave), 57_600)
    assert isinstance(transport, streams.SerialTransport)
    with FileIO(master, "r+b") as peer:
        yield transport, peer
        transport.close()
        os.close(slave)


@pytest.fixture
def tcp_line() -> Iterator[Ends]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        transport = open_transport(f"tcp://127.0.0.1:{server.getsockname()[1]}", 57_600)
        assert isinstance(transport, streams.TcpTransport)
        connection = server.accept()[0]
    with FileIO(connection.detach(), "r+b") as peer:
        yield transport, peer
        transport.close()


@pytest.fixture(params=["serial_line", "tcp_line"])
def ends(request: pytest.FixtureRequest) -> Ends:
    return request.getfixturevalue(request.param)


def test_bytes_pass_unchanged_in_both_directions(ends: Ends) -> None:
    transport, peer = ends
    data = bytes(range(256))
    transport.write(data)
    assert peer.read(1000) == data
    peer.write(data)
    assert transport.read(1000, 5.0) == data


def test_read_has_a_maximum_and_a_timeout(ends: Ends) -> None:
    transport, peer = ends
    peer.write(b"abcdef")
    assert transport.read(4, 5.0) == b"abcd"
    assert transport.read(4, 5.0) == b"ef"
    assert transport.read(10, 0.0) == b""
    assert transport.read(10, 0.001) == b""


@pytest.mark.parametrize("reopens", [True, False])
def test_reconnects_to_a_restarted_server(tcp_line: Ends, reopens: bool) -> None:
    transport, peer = tcp_line
    transport.reopens = reopens
    port = int(transport.name.rpartition(":")[2])
    peer.close()
    with pytest.raises(PortClosedError, match=r"tcp://127.0.0.1:\d+: the other side closed"):
        transport.read(10, 5.0)
    for _ in range(2):
        with pytest.raises(PortClosedError, match="refused" if reopens else transport.name):
            transport.read(10, 5.0)
    with socket.create_server(("127.0.0.1", port)) as server:
        if not reopens:
            with pytest.raises(PortClosedError):
                transport.read(10, 5.0)
            return
        transport.write(b"here")
        with server.accept()[0] as connection:
            assert connection.recv(10) == b"here"
            connection.sendall(b"again")
            assert transport.read(10, 5.0) == b"again"


def test_old_connection_is_closed_before_reconnecting(tcp_line: Ends) -> None:
    """A server for one client at a time would otherwise never accept the new connection."""
    transport, peer = tcp_line
    transport.reopens = True
    with socket.socket(fileno=os.dup(peer.fileno())) as server_side:
        server_side.settimeout(5.0)
        server_side.shutdown(socket.SHUT_WR)
        for error in ("the other side closed", "refused"):
            with pytest.raises(PortClosedError, match=error):
                transport.read(10, 5.0)
        assert server_side.recv(10) == b""


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("", "no target given"),
        ("tcp://host", "tcp://host: must be tcp://HOST:PORT"),
        ("tcp://:4000", "must be tcp://HOST:PORT"),
        ("tcp://host:port", "must be tcp://HOST:PORT"),
        ("tcp://host:99999", "must be tcp://HOST:PORT"),
        ("usb://1", "usb://1: no transport usb://; known: tcp://, rfc2217:// or a port's path"),
    ],
)
def test_rejects_invalid_targets(target: str, message: str) -> None:
    with pytest.raises(TargetError, match=message):
        open_transport(target, 57_600)
    assert issubclass(TargetError, ValueError)


class Port:
    """A pyserial port that can be unplugged (``out``); counts reopenings and timeout settings."""

    baudrates = (9600, 57_600)

    def __init__(self) -> None:
        self.out = False
        self.opened = 0
        self.said = b""
        self.timeouts = 0
        self.pending = b""
        self._baudrate, self._timeout = 57_600, 0.0

    def _check(self) -> None:
        if self.out:
            raise serial.SerialException("device disconnected")

    @property
    def baudrate(self) -> int:
        return self._baudrate

    @baudrate.setter
    def baudrate(self, baud: int) -> None:
        self._check()
        if baud not in self.baudrates:
            raise ValueError(baud)
        self._baudrate = baud

    @property
    def timeout(self) -> float:
        return self._timeout

    @timeout.setter
    def timeout(self, timeout_s: float) -> None:
        self.timeouts += 1
        self._timeout = timeout_s

    @property
    def in_waiting(self) -> int:
        return len(self.pending)

    def write(self, data: bytes) -> None:
        self._check()
        self.said += data

    def read(self, count: int) -> bytes:
        self._check()
        data, self.pending = self.pending[:count], self.pending[count:]
        return data

    def open(self) -> None:
        self._check()
        self.opened += 1

    def close(self) -> None:
        pass


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Port:
    made = Port()
    monkeypatch.setattr(serial, "serial_for_url", lambda *_of, **_how: made)
    return made


@pytest.fixture
def line(port: Port) -> SerialTransport:
    return SerialTransport("/dev/x", 57_600)


ACTS: list[Any] = [
    pytest.param(lambda line: line.write(b"a"), id="write"),
    pytest.param(lambda line: line.read(9, 0.0), id="read"),
    pytest.param(lambda line: line.set_baud(9600), id="baud"),
]


@pytest.mark.parametrize("act", ACTS)
def test_unplugged_port_is_reported(port: Port, line: SerialTransport, act: Any) -> None:
    port.out = True
    with pytest.raises(PortClosedError, match="/dev/x: device disconnected"):
        act(line)


@pytest.mark.parametrize("act", ACTS[:2])
@pytest.mark.parametrize("reopens", [False, True])
def test_port_is_reopened_only_if_requested(
    port: Port, line: SerialTransport, act: Any, reopens: bool
) -> None:
    line.reopens = reopens
    act(line)
    assert port.opened == 0
    port.out = True
    for _ in range(3):
        with pytest.raises(PortClosedError):
            act(line)
    port.out = False
    act(line)
    act(line)
    assert port.opened == int(reopens)


def test_set_baud_reports_unsupported_rates(port: Port, line: SerialTransport) -> None:
    assert (line.set_baud(9600), line.baud, port.baudrate) == (True, 9600, 9600)
    assert (line.set_baud(7), line.baud) == (False, 9600)


def test_read_returns_pending_bytes(port: Port, line: SerialTransport) -> None:
    port.pending = b"abcdef"
    assert line.read(4, 0.5) == b"abcd"
    assert line.read(4, 0.5) == b"ef"
    assert line.read(4, 0.5) == b""
    assert line.read(1, 0.5) == b""
    assert (port.timeout, port.timeouts) == (0.5, 1)  # setting it touches the port


def test_read_answer_stops_at_its_length_or_timeout(port: Port, line: SerialTransport) -> None:
    port.pending = b"abcd"
    assert read_answer(line, 4, 0.1) == b"abcd"
    port.pending = b"ef"
    assert read_answer(line, 4, 0.1) == b"ef"
    assert read_answer(line, 4, 0.1) == b""


def test_pty_whose_other_end_closes(serial_line: Ends) -> None:
    transport, peer = serial_line
    peer.close()
    with pytest.raises(PortClosedError, match=transport.name):
        transport.write(b"x")
