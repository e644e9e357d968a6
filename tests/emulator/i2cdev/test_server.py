"""The socket of the bus: clients that queue, die, flood, stop or talk nonsense."""

import errno
import os
import select
import socket
import stat
from contextlib import closing, suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cubestack.emulator.i2cdev import running, server
from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.server import _Client
from cubestack.emulator.ports.endpoint import PortError
from cubestack.firmware_model.formats import i2c_socket
from cubestack.firmware_model.formats import linux_i2c as linux

from .conftest import GREETING, TARGETS, packed

READ_WRITE = i2c_socket.pack_open(os.O_RDWR)
SLAVE = i2c_socket.pack_ioctl(linux.Ioctl.SLAVE, 0x1A)
LARGEST = i2c_socket.pack_rdwr([linux.RdwrMessage(0x1A, 1, 8192)] * 42)


def test_each_client_has_its_own_device_file(served):
    first, second = served.connect(), served.connect()
    assert served.ask(first, i2c_socket.Call.IOCTL, SLAVE) == (0, b"")
    assert served.ask(first, i2c_socket.Call.WRITE, b"\x41") == (1, b"")
    assert served.ask(second, i2c_socket.Call.READ, i2c_socket.pack_read(1)) == (-errno.ENXIO, b"")
    assert served.ask(first, i2c_socket.Call.READ, i2c_socket.pack_read(3)) == (3, b"ABC")


def test_calls_reach_an_open_file_by_its_key_until_it_is_closed(served):
    opener, caller = served.connect(), served.connect()
    assert served.ask(opener, i2c_socket.Call.OPEN, READ_WRITE, key=77) == (0, b"")
    assert served.ask(caller, i2c_socket.Call.IOCTL, SLAVE, key=77) == (0, b"")
    assert served.ask(caller, i2c_socket.Call.READ, i2c_socket.pack_read(1), key=77) == (1, b"\0")
    assert served.ask(caller, i2c_socket.Call.READ, i2c_socket.pack_read(1), key=78) == (
        -errno.EBADF,
        b"",
    )
    opener.socket.close()
    served.serve()
    assert served.ask(caller, i2c_socket.Call.READ, i2c_socket.pack_read(1), key=77) == (
        -errno.EBADF,
        b"",
    )


def test_reused_key_survives_the_end_of_its_former_client(served):
    """The kernel reuses an inode number before the server sees the old client's end."""
    old, new, caller = served.connect(), served.connect(), served.connect()
    served.ask(old, i2c_socket.Call.OPEN, READ_WRITE, key=77)
    served.ask(new, i2c_socket.Call.OPEN, READ_WRITE, key=77)
    old.socket.close()
    served.serve()
    assert served.ask(caller, i2c_socket.Call.IOCTL, SLAVE, key=77) == (0, b"")


def test_clients_take_turns_by_whole_transfers(served, registers):
    clients = [served.connect() for _ in range(4)]
    for client in clients:
        served.ask(client, i2c_socket.Call.IOCTL, SLAVE)
    registers.log.clear()
    for number, client in enumerate(clients):
        client.send(
            i2c_socket.Call.RDWR,
            i2c_socket.pack_rdwr([linux.RdwrMessage(0x1A, 0, 1, bytes([number]))] * 3),
        )
    served.serve()
    assert [client.receive()[0] for client in clients] == [3] * 4
    transfers = [registers.log[start : start + 4] for start in range(0, len(registers.log), 4)]
    assert sorted(transfer[0] for transfer in transfers) == [[0], [1], [2], [3]]
    assert all(t[0] == t[1] == t[2] and t[3] == -1 for t in transfers)


def test_calls_sent_together_are_answered_in_order(served):
    """All but the first are read before their turn."""
    client = served.connect()
    served.ask(client, i2c_socket.Call.IOCTL, SLAVE)
    client.socket.sendall(packed(i2c_socket.Call.READ, i2c_socket.pack_read(1)) * 3)
    served.serve()
    assert [client.receive() for _ in range(3)] == [(1, b"\0"), (1, b"\1"), (1, b"\2")]


def test_server_returns_the_largest_transfer(served):
    client = served.connect()
    client.send(i2c_socket.Call.RDWR, LARGEST)
    served.serve()
    client.socket.setblocking(False)  # the rest of the answer waits for room
    received = bytearray()
    while len(received) < i2c_socket.LENGTH.size + 4 + 42 * 8192:
        try:
            received += client.socket.recv(1 << 20)
        except BlockingIOError:
            served.serve()
    assert i2c_socket.LENGTH.unpack_from(received)[0] == 4 + 42 * 8192


@pytest.mark.slow
def test_client_that_does_not_read_blocks_no_other(served):
    stuck, other = served.connect(), served.connect()
    for _ in range(3):
        stuck.send(i2c_socket.Call.RDWR, LARGEST)
    served.serve()
    served.ask(other, i2c_socket.Call.IOCTL, SLAVE)
    assert served.ask(other, i2c_socket.Call.READ, i2c_socket.pack_read(1))[0] == 1


class Babbler:
    """A connection whose client asks again before the last answer is out."""

    looks = 0

    def setblocking(self, _flag: bool) -> None: ...

    def recv(self, _size: int) -> bytes:
        self.looks += 1
        assert self.looks < 10
        return GREETING if self.looks == 1 else packed(i2c_socket.Call.IOCTL, SLAVE)

    def send(self, data: bytes) -> int:
        return len(data)


def test_endlessly_sending_client_yields_after_each_call(adapter):
    babbler = Babbler()
    client = _Client(babbler, adapter, b"", {}, lambda _events: None)
    client.exchange(hung_up=False)
    client.exchange(hung_up=False)
    assert babbler.looks == 2


def test_unread_requests_wait_in_the_socket_buffer(served, registers):
    client = served.connect()
    client.socket.setblocking(False)
    frame, sent = packed(i2c_socket.Call.IOCTL, SLAVE), 0
    with suppress(BlockingIOError):
        while True:
            sent += client.socket.send(frame)
    assert sent < 1 << 20
    client.socket.setblocking(True)
    other = served.connect()
    assert served.ask(other, i2c_socket.Call.IOCTL, SLAVE) == (0, b"")
    for _ in range(sent // len(frame)):
        assert client.receive() == (0, b"")
        served.serve()


def test_partial_call_does_not_spin_the_server(served):
    client, call = served.connect(), packed(i2c_socket.Call.IOCTL, SLAVE)
    client.socket.sendall(call + call[:5])
    for _ in range(3):
        served.server.exchange(0)
    assert client.receive() == (0, b"")
    watched = [fileno for fileno, _ in served.server.watched()]
    assert not select.select(watched, [], [], 0)[0]
    client.socket.sendall(call[5:])
    served.serve()
    assert client.receive() == (0, b"")


@pytest.mark.parametrize("cut", [1, 4, 5, 12])
def test_client_that_dies_within_a_message_is_dropped(served, cut):
    client, other = served.connect(), served.connect()
    client.socket.sendall(packed(i2c_socket.Call.READ, i2c_socket.pack_read(1))[:cut])
    served.serve()
    client.reset()
    assert served.ask(other, i2c_socket.Call.IOCTL, SLAVE) == (0, b"")
    assert served.server.clients == 1


def test_transfer_completes_after_its_client_died(served, registers):
    client, other = served.connect(), served.connect()
    client.send(
        i2c_socket.Call.RDWR, i2c_socket.pack_rdwr([linux.RdwrMessage(0x1A, 0, 3, b"\x20\xaa\xbb")])
    )
    served.server.exchange(0)
    assert served.adapter.busy
    client.socket.close()
    served.server.exchange(0)
    assert served.ask(other, i2c_socket.Call.IOCTL, SLAVE) == (0, b"")
    assert registers.memory[0x20:0x22] == b"\xaa\xbb"  # the bus goes on
    assert served.server.clients == 1


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (
            i2c_socket.LENGTH.pack(i2c_socket.MAX_REQUEST_BYTES + 1),
            "a request has at most 344409 bytes, not 344410",
        ),
        (i2c_socket.LENGTH.pack(0), "a request has at least 9 bytes, not 0"),
        (i2c_socket.packet(bytes(8) + b"\x63"), "no call has the number 99"),
        (packed(i2c_socket.Call.IOCTL, b"x"), "the fields have 12 bytes, not 1"),
        (packed(i2c_socket.Call.RDWR, b"\xff" * 11), "a message of RDWR breaks off"),
        (packed(i2c_socket.Call.HELLO, b"x"), "the fields have 4 bytes, not 1"),
        (
            packed(i2c_socket.Call.HELLO, i2c_socket.pack_hello(2)),
            "this emulation speaks version 1 of the protocol, not 2",
        ),
    ],
)
def test_invalid_message_is_refused_in_words_and_closes_the_connection(served, data, words):
    client, other = served.connect(), served.connect()
    client.socket.sendall(data)
    served.serve()
    assert client.receive() == (-errno.EPROTO, words.encode())
    assert client.hung_up()
    assert served.ask(other, i2c_socket.Call.IOCTL, SLAVE) == (0, b"")


def test_connection_without_a_greeting_is_refused(served):
    client = served.connect(greeting=False)
    assert served.ask(client, i2c_socket.Call.IOCTL, SLAVE) == (
        -errno.EPROTO,
        b"a connection begins with HELLO, not with IOCTL",
    )
    assert client.hung_up()


def test_greeting_of_a_later_version_is_understood(served):
    """Later versions may append to it; ours stays the same."""
    client = served.connect(greeting=False)
    body = i2c_socket.pack_hello() + b"something new"
    result, data = served.ask(client, i2c_socket.Call.HELLO, body)
    assert (result, i2c_socket.unpack_targets(data)) == (i2c_socket.VERSION, TARGETS)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=100)
@given(st.binary(min_size=1, max_size=200))
def test_arbitrary_bytes_do_not_harm_the_server(served, data):
    client = served.connect()
    client.socket.sendall(i2c_socket.packet(data))
    served.serve()
    client.socket.close()
    served.serve()
    assert served.server.clients == 0
    assert not served.adapter.busy


def test_client_beyond_the_limit_of_descriptors_gets_enfile(served, monkeypatch):
    first = served.connect()
    monkeypatch.setattr(server, "has_room", lambda _descriptor: False)
    late = served.connect(greeting=False)
    assert late.receive() == (-errno.ENFILE, b"")
    assert late.hung_up()
    assert served.server.clients == 1
    monkeypatch.undo()
    assert served.ask(first, i2c_socket.Call.IOCTL, SLAVE) == (0, b"")
    assert served.ask(served.connect(), i2c_socket.Call.IOCTL, SLAVE) == (0, b"")


def test_hundreds_of_clients_are_served(served):
    clients = [served.connect() for _ in range(300)]
    assert served.server.clients == 300
    assert served.ask(clients[-1], i2c_socket.Call.IOCTL, SLAVE) == (0, b"")


@pytest.mark.parametrize(
    ("flags", "read", "write", "ioctl"),
    [
        (os.O_RDWR, 1, 1, 0),
        (os.O_RDONLY, 1, -errno.EBADF, 0),
        (os.O_WRONLY, -errno.EBADF, 1, 0),
        (os.O_ACCMODE, -errno.EBADF, -errno.EBADF, 0),
        (os.O_PATH, -errno.EBADF, -errno.EBADF, -errno.EBADF),
    ],
)
def test_flags_of_open_decide_which_calls_are_allowed(served, flags, read, write, ioctl):
    opener, caller = served.connect(), served.connect()
    body = i2c_socket.pack_open(flags | os.O_NONBLOCK)
    assert served.ask(opener, i2c_socket.Call.OPEN, body, key=5) == (0, b"")
    assert served.ask(caller, i2c_socket.Call.MODE, key=5) == (flags, b"")
    assert served.ask(caller, i2c_socket.Call.IOCTL, SLAVE, key=5)[0] == ioctl
    assert served.ask(caller, i2c_socket.Call.WRITE, b"\x41", key=5)[0] == write
    assert served.ask(caller, i2c_socket.Call.READ, i2c_socket.pack_read(1), key=5)[0] == read


def test_request_wakes_a_waiting_server(served):
    client = served.connect()
    served.wait(0.0)
    client.send(i2c_socket.Call.IOCTL, SLAVE)
    served.wait(20.0)  # returns at once
    served.serve()
    assert client.receive() == (0, b"")


def test_socket_path_must_be_free_in_a_private_folder(served, tmp_path, serve_at):
    bus = Path(served.server.name)
    assert stat.S_IMODE(bus.parent.stat().st_mode) == 0o700
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o750)
    (tmp_path / "link").symlink_to(bus.parent)
    file = bus.with_name("file")
    file.write_text("precious")
    for path, message in (
        (tmp_path / "open" / "bus", "of this user only: chmod 700"),
        (tmp_path / "link" / "new", "of this user only"),
        (bus, "is already in use"),
        (file, "is not a socket"),
        (tmp_path / ("x" * 120) / "bus", "too long"),
    ):
        with pytest.raises(PortError, match=message):
            serve_at(path)
    assert file.read_text() == "precious"


def test_stale_socket_of_a_dead_emulation_is_replaced(served, serve_at):
    path = Path(served.server.name).with_name("dead")
    dead = socket.socket(socket.AF_UNIX)
    dead.bind(str(path))
    dead.close()
    assert serve_at(path).name == str(path)


def test_closing_removes_the_socket(tmp_path, serve_at):
    server = serve_at(tmp_path / "private" / "bus")
    server.close()
    assert not os.path.lexists(server.name)


def test_preload_program_is_served_until_it_exits(
    adapter: I2cAdapter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "shim_library", lambda: tmp_path / "none.so")
    bus = running.emulated_bus(adapter.env, lambda: False, adapter, tmp_path / "bus")
    said: list[str] = []
    command = ["sh", "-c", "exit 3"]
    with closing(bus.port):
        code = running.run_program(
            command, 7, bus, pace="fast", route="preload", report=said.append
        )
    assert code == 3
    assert said[0] == "/dev/i2c-7 is served by preload, as requested"
