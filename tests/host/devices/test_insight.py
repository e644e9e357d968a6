"""A debugger's port goes with its device."""

import socket
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.boards import debugging
from cubestack.emulator.ports.gdb import GdbEndpoint
from cubestack.host.devices.insight import open_gdb


def test_a_closed_device_listens_for_no_debugger(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        debugging, "open_debugger", lambda _board, port, **_: GdbEndpoint(port, target)
    )
    target: Any = SimpleNamespace()
    emulated: Any = SimpleNamespace(board=SimpleNamespace(insight=object(), on_close=[]))
    endpoint = open_gdb(emulated, 0, wait=False)
    socket.create_connection(endpoint.address).close()
    for act in emulated.board.on_close:
        act()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(endpoint.address)
