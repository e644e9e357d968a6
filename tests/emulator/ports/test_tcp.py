"""TCP and debugger ports: addresses, and who is served."""

import contextlib
import select
import socket
from typing import Any

import pytest

from cubestack.emulator.ports.endpoint import PortError
from cubestack.emulator.ports.gdb import GdbEndpoint
from cubestack.emulator.ports.tcp import TcpEndpoint
from tests.emulator.iss.gdb.fake_target import FakeTarget

from .checks import a_tcp, assert_fresh
from .conftest import LOOPBACK, open_client


@pytest.mark.parametrize(
    ("host", "port", "text"),
    [
        (LOOPBACK, -1, r"TCP port -1 is not in 0\.\.65535"),
        (LOOPBACK, 65536, r"TCP port 65536 is not in 0\.\.65535"),
        ("0.0.0.0", 0, "0.0.0.0 is open to other machines"),
        ("::", 0, ":: is open to other machines"),
        *((host, 0, "is not an address of") for host in ("", "no.such.invalid", "a" * 70)),
    ],
)
def test_invalid_tcp_address_is_rejected(device, host, port, text):
    with pytest.raises(PortError, match=text):
        TcpEndpoint(host, port, device.uart)


def test_tcp_accepts_other_machines_when_allowed(device):
    endpoint = TcpEndpoint("0.0.0.0", 0, device.uart, allow_remote=True)
    assert endpoint.address[0] == "0.0.0.0"
    endpoint.close()


def test_tcp_port_is_in_use_until_closed_and_closing_drops_the_client(device):
    first = TcpEndpoint(LOOPBACK, 0, device.uart)
    number = first.address[1]
    assert first.name == f"tcp://127.0.0.1:{number}"
    with pytest.raises(PortError, match=r"can not listen on 127\.0\.0\.1:\d+: .*another port"):
        TcpEndpoint(LOOPBACK, number, device.uart)
    with contextlib.closing(open_client(first)) as client:
        first.exchange(0)
        first.close()
        assert client.socket.recv(1) == b""
        TcpEndpoint(LOOPBACK, number, device.uart).close()


@a_tcp
def test_tcp_second_client_is_refused_with_a_line(port, device, connect):
    first, second = connect(), connect()
    assert b"has a client already" in second.read(43)
    assert second.socket.recv(1) == b""
    assert_fresh(port, device, first)


@a_tcp
@pytest.mark.parametrize("leave", ["close", "reset"])
def test_tcp_client_that_reconnects_at_once_is_served(port, device, connect, leave):
    """Both happen before the port gets a look in."""
    for _ in range(5):
        client = connect()
        assert_fresh(port, device, client)
        device.sends(port, b"never read")
        getattr(client, leave)()


@a_tcp
def test_tcp_client_receives_the_answer_after_closing_its_send_side(port, device, connect):
    device.answers = 1
    client = connect()
    client.write(b"question")
    client.socket.shutdown(socket.SHUT_WR)
    assert device.hears(port, 8) == b"question"
    port.exchange(device.advance(20))
    assert client.read(8) == b"question"


def test_gdb_port_polls_for_output_only_while_data_is_unsent() -> None:
    target: Any = FakeTarget()
    endpoint = GdbEndpoint(0, target)
    (server,) = endpoint.watched()
    assert server[1] == select.POLLIN
    with socket.create_connection(endpoint.address) as client:
        endpoint.serve(1.0)
        assert endpoint.connected
        assert [events for _, events in endpoint.watched()] == [select.POLLIN] * 2
        session = endpoint._session
        assert session is not None
        session.output.extend(b"+")
        assert endpoint.watched()[1][1] == select.POLLIN | select.POLLOUT
        endpoint.exchange(0)
        assert client.recv(10) == b"+"
        assert endpoint.watched()[1][1] == select.POLLIN
    endpoint.close()
    assert not endpoint.connected


@pytest.mark.parametrize("port", [-1, 65_536])
def test_rejects_invalid_ports(port: int) -> None:
    with pytest.raises(PortError, match=f"TCP port {port} is not in 0..65535"):
        GdbEndpoint(port, FakeTarget())  # type: ignore[arg-type]
