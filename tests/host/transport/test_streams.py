import os
import socket
import tty
from collections.abc import Iterator
from io import FileIO

import pytest

from cubestack.host.errors import PortClosedError, TargetError
from cubestack.host.transport import streams
from cubestack.host.transport.streams import Transport, open_transport

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
def line(request: pytest.FixtureRequest) -> Ends:
    return request.getfixturevalue(request.param)


def test_bytes_pass_unchanged_in_both_directions(line: Ends) -> None:
    transport, peer = line
    data = bytes(range(256))
    transport.write(data)
    assert peer.read(1000) == data
    peer.write(data)
    assert transport.read(1000, 5.0) == data


def test_read_has_a_maximum_and_a_timeout(line: Ends) -> None:
    transport, peer = line
    peer.write(b"abcdef")
    assert transport.read(4, 5.0) == b"abcd"
    assert transport.read(4, 5.0) == b"ef"
    assert transport.read(10, 0.0) == b""
    assert transport.read(10, 0.001) == b""


@pytest.mark.parametrize("reopens", [True, False])
def test_reconnects_to_a_restarted_server(tcp_line: Ends, reopens: bool) -> None:
    transport, peer = tcp_line
    assert isinstance(transport, streams.TcpTransport)
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
    assert isinstance(transport, streams.TcpTransport)
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
