"""The TCP port against real sockets, with every look of the scheduler made by the test."""

import contextlib
import socket

import pytest

from cubestack.emulator.ports.endpoint import PortError, poll_now
from cubestack.emulator.ports.realtime import wait_ready
from cubestack.emulator.ports.serial_port import MAX_UNSENT
from cubestack.emulator.ports.tcp import TcpEndpoint

ALL_BYTES = bytes(range(256))
LOOPBACK = "127.0.0.1"
TIMEOUT_S = 20.0


def ready(port: TcpEndpoint) -> list[int]:
    """Which of the port's descriptors would wake the scheduler at once."""
    return [fd for fd, events in port.watched() if poll_now(fd, events)]


def test_tcp_is_transparent_both_ways(tcp, device, connect):
    client = connect()
    device.sends(tcp, ALL_BYTES)
    assert client.receive(256) == ALL_BYTES
    client.socket.sendall(ALL_BYTES)
    assert device.hears(tcp, 256) == ALL_BYTES


def test_tcp_name_tells_how_to_open_it(tcp):
    assert tcp.name == f"tcp://127.0.0.1:{tcp.address[1]}"


def test_tcp_port_that_is_taken(tcp, device):
    with pytest.raises(PortError, match=r"can not listen on 127\.0\.0\.1:\d+: .*another port"):
        TcpEndpoint(LOOPBACK, tcp.address[1], device.uart)


def test_tcp_port_is_free_after_close(device, connection_to):
    first = TcpEndpoint(LOOPBACK, 0, device.uart)
    client = connection_to(first.address)
    first.exchange(0)
    first.close()
    second = TcpEndpoint(LOOPBACK, first.address[1], device.uart)
    second.close()
    client.close()


@pytest.mark.parametrize("port", [-1, 65536])
def test_tcp_port_out_of_range(device, port):
    with pytest.raises(PortError, match=rf"TCP port {port} is not in 0\.\.65535"):
        TcpEndpoint(LOOPBACK, port, device.uart)


@pytest.mark.parametrize("host", ["0.0.0.0", "::"])
def test_tcp_is_for_this_machine_only(device, host):
    with pytest.raises(PortError, match=f"{host} is open to other machines"):
        TcpEndpoint(host, 0, device.uart)


def test_tcp_for_other_machines_when_allowed(device):
    endpoint = TcpEndpoint("0.0.0.0", 0, device.uart, allow_remote=True)
    assert endpoint.address[0] == "0.0.0.0"
    endpoint.close()


@pytest.mark.parametrize("host", ["", "no.such.host.invalid", "a" * 70])
def test_tcp_host_that_does_not_exist(device, host):
    with pytest.raises(PortError, match="no address of this machine"):
        TcpEndpoint(host, 0, device.uart)


def test_tcp_second_client_is_refused_with_a_line(tcp, device, connect):
    first, second = connect(), connect()
    assert b"has a client already" in second.receive(43)
    assert second.socket.recv(1) == b""
    device.sends(tcp, b"mine")
    assert first.receive(4) == b"mine"


@pytest.mark.parametrize("leave", ["close", "reset"])
def test_tcp_client_that_reconnects_at_once_is_served(tcp, device, connect, leave):
    """Both happen before the port gets a look in."""
    for round_ in range(5):
        client = connect()
        answer = b"round %d" % round_
        device.sends(tcp, answer)
        assert client.receive(7) == answer
        device.sends(tcp, b"never read")
        getattr(client, leave)()


@pytest.mark.parametrize("leave", ["close", "reset"])
def test_tcp_client_gets_nothing_that_the_one_before_left(tcp, device, connect, leave):
    first = connect()
    device.sends(tcp, bytes(500_000))
    getattr(first, leave)()
    second = connect()
    device.sends(tcp, b"fresh")
    assert second.receive(5) == b"fresh"


def test_tcp_client_that_has_sent_all_still_gets_the_answer(tcp, device, connect):
    device.echoes = True
    client = connect()
    client.socket.sendall(b"question")
    client.socket.shutdown(socket.SHUT_WR)
    assert device.hears(tcp, 8) == b"question"
    tcp.exchange(device.advance(20))
    assert client.receive(8) == b"question"


@pytest.mark.parametrize("leave", ["close", "reset"])
def test_tcp_client_that_dies_in_mid_frame(tcp, device, connect, leave):
    first = connect()
    first.socket.sendall(b"half a fra")
    assert device.hears(tcp, 10) == b"half a fra"
    getattr(first, leave)()
    for _ in range(3):
        device.sends(tcp, b"to nobody")
    second = connect()
    second.socket.sendall(b"whole")
    assert device.hears(tcp, 15) == b"half a frawhole"
    device.sends(tcp, b"fresh")
    assert second.receive(5) == b"fresh"


def test_tcp_client_that_floods_and_dies_makes_room(tcp, device, connect):
    first = connect()
    first.socket.setblocking(False)
    sent = 0
    with contextlib.suppress(BlockingIOError):
        while True:
            sent += first.socket.send(bytes(1 << 20))
    tcp.exchange(device.kernel.now)
    assert device.uart.host_backlog == MAX_UNSENT < sent
    assert ready(tcp) == []
    first.reset()
    assert ready(tcp) == []
    second = connect()
    device.sends(tcp, b"fresh")
    assert second.receive(5) == b"fresh"


def test_tcp_without_anything_to_do_wakes_nobody(tcp, device, connect):
    assert ready(tcp) == []
    client = connect()
    tcp.exchange(device.kernel.now)
    assert ready(tcp) == []
    client.close()
    wait_ready(tcp.watched(), TIMEOUT_S)
    tcp.exchange(device.kernel.now)
    assert ready(tcp) == []


def test_tcp_client_that_never_reads_wakes_nobody(tcp, device, connect):
    connect()
    device.wait_for(lambda: tcp.congested, doing=lambda: device.sends(tcp, bytes(1 << 20)))
    device.wait_for(lambda: not ready(tcp), doing=lambda: tcp.exchange(device.kernel.now))
    assert tcp.congested


def test_tcp_close_drops_the_client(device, connection_to):
    endpoint = TcpEndpoint(LOOPBACK, 0, device.uart)
    with contextlib.closing(connection_to(endpoint.address)) as client:
        endpoint.exchange(0)
        endpoint.close()
        assert client.socket.recv(1) == b""
