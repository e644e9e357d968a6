"""Device files of another process's bus, with the server in this one."""

import errno
import os
import select
import socket
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev import remote as remote_module
from cubestack.emulator.i2cdev.remote import RemoteBus
from cubestack.emulator.ports.endpoint import PortError
from cubestack.firmware_model.formats import linux_i2c as linux


class Remote:
    """A remote bus beside its server, both driven by hand."""

    def __init__(self, served) -> None:
        self.served = served
        self.bus = RemoteBus(Path(served.server.name))

    def ask(self, file, call: linux.Call, body: bytes) -> tuple[int, bytes]:
        replies: list[bytes] = []
        file.perform(call, body, replies.append)
        while not replies:
            self.served.serve()
            self.bus.exchange(0)
        return linux.split_reply(replies[0])


@pytest.fixture
def remote(served):
    remote = Remote(served)
    yield remote
    remote.bus.close()


def test_remote_bus_files_have_independent_addresses(remote):
    first, second = remote.bus.open(), remote.bus.open()
    assert remote.ask(first, linux.Call.IOCTL, linux.pack_ioctl(linux.Ioctl.SLAVE, 0x1A)) == (
        0,
        b"",
    )
    assert remote.ask(first, linux.Call.READ, linux.pack_read(2)) == (2, b"\0\1")
    assert remote.ask(second, linux.Call.READ, linux.pack_read(2)) == (-errno.ENXIO, b"")


def test_remote_bus_transfers_the_largest_messages_in_both_directions(remote, registers):
    registers.i2c_write = lambda _byte: True
    file = remote.bus.open()
    messages = [linux.RdwrMessage(0x1A, 0, 8192, bytes(8192))] * 21 + [
        linux.RdwrMessage(0x1A, 1, 8192)
    ] * 21
    result, data = remote.ask(file, linux.Call.RDWR, linux.pack_rdwr(messages))
    assert (result, len(data)) == (42, 21 * 8192)


def test_answers_come_in_the_order_of_the_calls(remote):
    file = remote.bus.open()
    results: dict[int, int] = {}
    for argument in (0x80, 0x1A, 0x1B):
        file.perform(
            linux.Call.IOCTL,
            linux.pack_ioctl(linux.Ioctl.SLAVE, argument),
            lambda reply, argument=argument: results.update(
                {argument: linux.split_reply(reply)[0]}
            ),
        )
    while len(results) < 3:
        remote.served.serve()
        remote.bus.exchange(0)
    assert results == {0x80: -errno.EINVAL, 0x1A: 0, 0x1B: 0}


def test_client_sees_the_emulation_end(remote):
    file = remote.bus.open()
    replies: list[bytes] = []
    file.perform(linux.Call.READ, linux.pack_read(1), replies.append)
    remote.served.server.close()
    remote.bus.exchange(0)
    file.perform(linux.Call.READ, linux.pack_read(1), replies.append)
    assert [linux.split_reply(reply)[0] for reply in replies] == [-errno.EIO] * 2
    remote.bus.exchange(0)
    file.close()


def test_reports_missing_server(tmp_path):
    with pytest.raises(PortError, match=r"no emulation serves .*start one with cubestack emulate"):
        RemoteBus(tmp_path / "bus")


def test_close_releases_descriptors_and_fails_pending_calls(served):
    before = set(os.listdir("/proc/self/fd"))
    bus = RemoteBus(Path(served.server.name))
    files = [bus.open() for _ in range(3)]
    replies: list[bytes] = []
    files[0].perform(linux.Call.READ, linux.pack_read(1), replies.append)
    files[1].close()
    files[1].close()
    assert len(bus.watched()) == 1
    bus.close()
    assert [linux.split_reply(reply)[0] for reply in replies] == [-errno.EIO]
    files[2].perform(linux.Call.READ, linux.pack_read(1), replies.append)
    assert len(replies) == 2
    served.serve()  # whose ends are hung up now
    assert set(os.listdir("/proc/self/fd")) == before


def test_write_blocks_while_the_peer_does_not_read():
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    watched: list[int] = []
    file = remote_module._RemoteFile(ours, watched.append, lambda: None)
    call = linux.pack_read(1)
    file.perform(linux.Call.READ, call, lambda _reply: None)
    assert watched == []
    while not watched:
        file.perform(linux.Call.WRITE, bytes(8192), lambda _reply: None)
    assert watched == [select.EPOLLIN | select.EPOLLOUT]
    theirs.setblocking(False)
    while len(watched) == 1:
        theirs.recv(1 << 20)
        file.exchange()
    assert watched[1:] == [select.EPOLLIN]
    file.close()
    theirs.close()
