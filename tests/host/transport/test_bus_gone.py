import os
import socket
import stat
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from cubestack.firmware_model.formats import linux_i2c
from cubestack.host.errors import PortClosedError
from cubestack.host.transport.smbus import CubeSMBus, _find_socket


@pytest.fixture
def server(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listening:
        listening.bind(str(tmp_path / "bus"))
        listening.listen()
        yield listening


@pytest.mark.parametrize("reply", [b"", b"\x01", b"\x10\x00\x00\x00abc"])
def test_emulation_that_ends_during_an_answer(
    server: socket.socket, tmp_path: Path, reply: bytes
) -> None:
    def answer() -> None:
        connection = server.accept()[0]
        with connection:
            connection.recv(1 << 12)
            if reply:
                connection.sendall(reply)

    serving = threading.Thread(target=answer)
    serving.start()
    with pytest.raises(PortClosedError, match="the emulation has ended"):
        CubeSMBus(str(tmp_path / "bus"))
    serving.join()


def test_open_bus_has_a_file_descriptor(server: socket.socket, tmp_path: Path) -> None:
    def answer() -> None:
        with server.accept()[0] as connection:
            connection.recv(1 << 12)
            functions = linux_i2c.reply(0, bytes(8))
            connection.sendall(linux_i2c.LENGTH.pack(len(functions)) + functions)

    serving = threading.Thread(target=answer)
    serving.start()
    bus = CubeSMBus(str(tmp_path / "bus"))
    serving.join()
    assert stat.S_ISSOCK(os.fstat(bus.fd).st_mode)
    bus.close()
    assert bus.fd is None


@pytest.mark.parametrize(
    ("around", "number", "own"),
    [("7", "7", True), ("7", "8", False), (None, "7", False), ("7", None, False)],
)
def test_program_under_run_uses_its_bus(
    monkeypatch: pytest.MonkeyPatch, around: str | None, number: str | None, own: bool
) -> None:
    for name, value in (("BUS", around), ("SOCKET", "/the/socket" if number else None)):
        if value is None:
            monkeypatch.delenv(f"CUBESTACK_I2C_{name}", raising=False)
        else:
            monkeypatch.setenv(f"CUBESTACK_I2C_{name}", value)
    wanted = int(number or 7)
    served = Path("/the/socket") if own else linux_i2c.socket_path(wanted)
    assert _find_socket(wanted) == _find_socket(f"/dev/i2c-{wanted}") == served
    assert _find_socket("/some/where") == Path("/some/where")
