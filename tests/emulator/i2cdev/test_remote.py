"""Device files of another process's bus, with the server in this one."""

import errno
import os
import select
import socket
import threading
from contextlib import closing
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev import remote as remote_module
from cubestack.emulator.i2cdev.remote import RemoteBus
from cubestack.emulator.ports.endpoint import PortError
from cubestack.firmware_model.formats import i2c_socket
from cubestack.firmware_model.formats import linux_i2c as linux

from .conftest import TARGETS


class Remote:
    """A remote bus beside its server, both driven by hand."""

    def __init__(self, served) -> None:
        self.served = served
        self.bus = RemoteBus(Path(served.server.name))

    def ask(self, file, call: i2c_socket.Call, body: bytes) -> tuple[int, bytes]:
        replies: list[bytes] = []
        file.perform(call, body, replies.append)
        while not replies:
            self.served.serve()
            self.bus.exchange(0)
        return i2c_socket.split_reply(replies[0])


@pytest.fixture
def remote(served):
    remote = Remote(served)
    yield remote
    remote.bus.close()


def test_remote_bus_files_have_independent_addresses(remote):
    first, second = remote.bus.open(), remote.bus.open()
    assert remote.ask(
        first, i2c_socket.Call.IOCTL, i2c_socket.pack_ioctl(linux.Ioctl.SLAVE, 0x1A)
    ) == (0, b"")
    assert remote.ask(first, i2c_socket.Call.READ, i2c_socket.pack_read(2)) == (2, b"\0\1")
    assert remote.ask(second, i2c_socket.Call.READ, i2c_socket.pack_read(2)) == (-errno.ENXIO, b"")


@pytest.mark.slow
def test_remote_bus_transfers_the_largest_messages_in_both_directions(remote, registers):
    registers.i2c_write = lambda _byte: True
    file = remote.bus.open()
    messages = [linux.RdwrMessage(0x1A, 0, 8192, bytes(8192))] * 21 + [
        linux.RdwrMessage(0x1A, 1, 8192)
    ] * 21
    result, data = remote.ask(file, i2c_socket.Call.RDWR, i2c_socket.pack_rdwr(messages))
    assert (result, len(data)) == (42, 21 * 8192)


def test_answers_come_in_the_order_of_the_calls(remote):
    file = remote.bus.open()
    results: dict[int, int] = {}
    for argument in (0x80, 0x1A, 0x1B):
        file.perform(
            i2c_socket.Call.IOCTL,
            i2c_socket.pack_ioctl(linux.Ioctl.SLAVE, argument),
            lambda reply, argument=argument: results.update(
                {argument: i2c_socket.split_reply(reply)[0]}
            ),
        )
    while len(results) < 3:
        remote.served.serve()
        remote.bus.exchange(0)
    assert results == {0x80: -errno.EINVAL, 0x1A: 0, 0x1B: 0}


def test_client_sees_the_emulation_end(remote):
    file = remote.bus.open()
    replies: list[bytes] = []
    file.perform(i2c_socket.Call.READ, i2c_socket.pack_read(1), replies.append)
    remote.served.server.close()
    remote.bus.exchange(0)
    file.perform(i2c_socket.Call.READ, i2c_socket.pack_read(1), replies.append)
    assert [i2c_socket.split_reply(reply)[0] for reply in replies] == [-errno.EIO] * 2
    remote.bus.exchange(0)
    file.close()


def test_greeting_returns_the_devices_of_the_bus(remote):
    greeted = threading.Event()

    def serve() -> None:
        while not greeted.is_set():
            remote.served.serve()

    serving = threading.Thread(target=serve)
    serving.start()
    try:
        assert remote.bus.greet() == TARGETS
    finally:
        greeted.set()
        serving.join()


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (i2c_socket.reply(-errno.EPROTO, b"version 3, please"), "refuses: version 3, please"),
        (i2c_socket.reply(-errno.ENFILE), "refuses: Too many open files in system"),
        (None, "has ended"),
    ],
)
def test_emulation_that_refuses_the_greeting_is_reported(tmp_path, answer, message):
    path = tmp_path / "bus"
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(path))
        listening.listen()
        with closing(RemoteBus(path)) as bus:
            listening.accept()[0].close()  # the probe of the constructor

            def answer_once() -> None:
                with listening.accept()[0] as link:
                    link.recv(100)
                    link.sendall(i2c_socket.packet(answer) if answer else b"")

            answering = threading.Thread(target=answer_once)
            answering.start()
            with pytest.raises(PortError, match=message):
                bus.greet()
            answering.join()


def test_silent_emulation_is_reported(remote, monkeypatch):
    monkeypatch.setattr(remote_module, "PATIENCE_S", 0.01)
    with pytest.raises(PortError, match="does not answer; is that emulation paused"):
        remote.bus.greet()


def test_reports_missing_server(tmp_path):
    with pytest.raises(PortError, match=r"no emulation serves .*start one with cubestack emulate"):
        RemoteBus(tmp_path / "bus")


def test_close_releases_descriptors_and_fails_pending_calls(served):
    before = set(os.listdir("/proc/self/fd"))
    bus = RemoteBus(Path(served.server.name))
    files = [bus.open() for _ in range(3)]
    replies: list[bytes] = []
    files[0].perform(i2c_socket.Call.READ, i2c_socket.pack_read(1), replies.append)
    files[1].close()
    files[1].close()
    assert len(bus.watched()) == 1
    bus.close()
    assert [i2c_socket.split_reply(reply)[0] for reply in replies] == [-errno.EIO]
    files[2].perform(i2c_socket.Call.READ, i2c_socket.pack_read(1), replies.append)
    assert len(replies) == 2
    served.serve()  # whose ends are hung up now
    assert set(os.listdir("/proc/self/fd")) == before


def test_write_blocks_while_the_peer_does_not_read():
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    watched: list[int] = []
    file = remote_module._RemoteFile(ours, watched.append, lambda: None)
    call = i2c_socket.pack_read(1)
    file.perform(i2c_socket.Call.READ, call, lambda _reply: None)
    assert watched == []
    while not watched:
        file.perform(i2c_socket.Call.WRITE, bytes(8192), lambda _reply: None)
    assert watched == [select.EPOLLIN | select.EPOLLOUT]
    theirs.setblocking(False)
    while len(watched) == 1:
        theirs.recv(1 << 20)
        file.exchange()
    assert watched[1:] == [select.EPOLLIN]
    file.close()
    theirs.close()
