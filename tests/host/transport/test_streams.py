import os
import socket
import tty
from collections.abc import Iterator

import pytest

from cubestack.host.errors import PortClosedError, PortOpenError, TargetError, TransportError
from cubestack.host.transport.streams import (
    SerialTransport,
    TcpTransport,
    Transport,
    open_transport,
)


class Peer:
    """The far end of a line."""

    def __init__(self, descriptor: int, close: object) -> None:
        self.descriptor = descriptor
        self.close = close

    def send(self, data: bytes) -> None:
        os.write(self.descriptor, data)

    def receive(self) -> bytes:
        return os.read(self.descriptor, 1000)


@pytest.fixture
def serial_line() -> Iterator[tuple[Transport, Peer]]:
    master, slave = os.openpty()
    tty.setraw(slave)
    transport = open_transport(os.ttyname(slave), 57_600)
    assert isinstance(transport, SerialTransport)
    yield transport, Peer(master, lambda: os.close(master))
    transport.close()
    os.close(slave)
    os.close(master)


@pytest.fixture
def tcp_line() -> Iterator[tuple[Transport, Peer]]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        transport = open_transport(f"tcp://127.0.0.1:{server.getsockname()[1]}", 57_600)
        assert isinstance(transport, TcpTransport)
        connection = server.accept()[0]
    with connection:
        yield transport, Peer(connection.fileno(), connection.close)
        transport.close()


@pytest.fixture(params=["serial_line", "tcp_line"])
def line(request: pytest.FixtureRequest) -> tuple[Transport, Peer]:
    found: tuple[Transport, Peer] = request.getfixturevalue(request.param)
    return found


def test_bytes_go_both_ways_unchanged(line: tuple[Transport, Peer]) -> None:
    transport, peer = line
    data = bytes(range(256))
    transport.write(data)
    assert peer.receive() == data
    peer.send(data)
    assert transport.read(1000, 5.0) == data


def test_a_read_takes_no_more_than_asked_for(line: tuple[Transport, Peer]) -> None:
    transport, peer = line
    peer.send(b"abcdef")
    assert transport.read(4, 5.0) == b"abcd"
    assert transport.read(4, 5.0) == b"ef"


def test_silence_is_empty(line: tuple[Transport, Peer]) -> None:
    transport, _ = line
    assert transport.read(10, 0.0) == b""
    assert transport.read(10, 0.001) == b""


def test_a_closed_connection_is_told(tcp_line: tuple[Transport, Peer]) -> None:
    transport, peer = tcp_line
    peer.close()  # type: ignore[operator]
    with pytest.raises(PortClosedError, match=r"tcp://127.0.0.1:\d+: the other side closed"):
        transport.read(10, 5.0)


def test_a_missing_port_is_told_in_one_line() -> None:
    with pytest.raises(PortOpenError) as caught:
        open_transport("/dev/ttyMISSING7", 57_600)
    assert str(caught.value) == "can not open /dev/ttyMISSING7: No such file or directory"


def test_a_refused_connection_is_told_in_one_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(TransportError) as caught:
        open_transport(f"tcp://127.0.0.1:{port}", 57_600)
    assert str(caught.value) == f"can not open tcp://127.0.0.1:{port}: Connection refused"


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
def test_a_target_without_sense_is_a_wrong_call(target: str, message: str) -> None:
    with pytest.raises(TargetError, match=message) as caught:
        open_transport(target, 57_600)
    assert isinstance(caught.value, ValueError)
