"""The port of a debugger: what is waited for."""

import select
import socket
from typing import Any

import pytest

from cubestack.emulator.ports.endpoint import PortError
from cubestack.emulator.ports.gdb import GdbEndpoint
from tests.emulator.iss.gdb.fake_target import FakeTarget


def test_writing_is_waited_for_while_something_is_unsent() -> None:
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
