"""The ports against real programs, with every look of the scheduler made by the test."""

import contextlib
import fcntl
import itertools
import os
import select
import socket
import struct
import subprocess
import sys
import termios
import tty
from collections.abc import Callable
from types import FrameType
from typing import Any

import pytest

from cubestack.emulator.ports.endpoint import PortError
from cubestack.emulator.ports.gdb import GdbEndpoint
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.ports.realtime import wait_ready
from cubestack.emulator.ports.serial_port import MAX_UNSENT
from cubestack.emulator.ports.tcp import MAX_AHEAD_AT_ONCE, TCP_RECEIVE_BUFFER, TcpEndpoint
from tests.emulator.iss.gdb.fake_target import FakeTarget

from .conftest import ALL_BYTES, LOOPBACK, TIMEOUT_S, open_client, ready

TIOCGEXCL = 0x80045440  # linux/asm-generic/ioctls.h; termios has the setters only

a_pty = pytest.mark.parametrize("kind", ["pty"])
a_tcp = pytest.mark.parametrize("kind", ["tcp"])


def assert_transparent(port, device, client) -> None:
    device.sends(port, ALL_BYTES)
    assert client.read(256) == ALL_BYTES
    assert client.write(ALL_BYTES) == 256
    assert device.hears(port, 256) == ALL_BYTES


def hears(client) -> bool:
    """Whether something has arrived that it can read."""
    return bool(select.select([client.fd], [], [], 0)[0])


def unsent(client) -> int:
    """Bytes that it has written and the port has not taken."""
    count = fcntl.ioctl(client.fd, termios.TIOCOUTQ, bytes(4))
    return struct.unpack("i", count)[0]


def assert_fresh(port, device, client) -> None:
    device.sends(port, b"fresh")
    assert client.read(5) == b"fresh"


@pytest.mark.parametrize("leave", ["close", "reset"])
@pytest.mark.parametrize("unread", [1, 100, 60_000, 500_000])
def test_client_receives_no_data_of_its_predecessor(port, device, connect, unread, leave):
    first = connect()
    for _ in range(0, unread, 10_000):
        device.sends(port, b"stale" * min(unread, 2000))
    getattr(first, leave)()
    port.exchange(device.kernel.now)
    assert_fresh(port, device, connect())


def test_drops_output_without_a_client(port, device, connect):
    device.sends(port, b"stale")
    assert_fresh(port, device, connect())


def test_input_of_a_client_that_closes_at_once_arrives(port, device):
    with contextlib.closing(open_client(port)) as client:
        client.write(b"last words")
    assert device.hears(port, 10) == b"last words"


@pytest.mark.parametrize("leave", ["close", "reset"])
def test_bytes_of_a_client_that_dies_within_a_frame_are_kept(port, device, connect, leave):
    first = connect()
    first.write(b"half a fra")
    assert device.hears(port, 10) == b"half a fra"
    getattr(first, leave)()
    for _ in range(3):
        device.sends(port, b"to nobody")
    second = connect()
    second.write(b"whole")
    assert device.hears(port, 15) == b"half a frawhole"
    assert_fresh(port, device, second)


@a_tcp
def test_flood_of_a_client_that_has_left_does_not_keep_the_next_one_out(port, device, connect):
    """The end of its connection lies behind megabytes that the line had no time for."""
    first = connect()
    first.socket.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while True:
            first.socket.send(bytes(1 << 16))
    first.close()
    port.exchange(device.kernel.now)
    second = connect()
    device.wait_for(lambda: hears(second), doing=lambda: device.sends(port, b"."))
    assert second.read(1) == b"."


@a_tcp
def test_flood_is_read_in_bounded_parts(port, device, connect):
    """So that the device has its turn in between, whoever wants to be the next client."""
    first = connect()
    first.socket.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while True:
            first.socket.send(bytes(1 << 16))
    port.exchange(device.kernel.now)
    connect()
    for _ in range(3):
        before = unsent(first)
        port.exchange(device.kernel.now)
        assert unsent(first) >= before - MAX_AHEAD_AT_ONCE - 4 * TCP_RECEIVE_BUFFER
        assert ready(port)


@a_tcp
def test_client_that_floods_and_stays_keeps_its_bytes(port, device, connect):
    """Although what it sent is read when another one comes, to find out whether it has left."""
    first = connect()
    first.socket.setblocking(False)
    sent = 0
    with contextlib.suppress(BlockingIOError):
        while sent < 300_000:
            sent += first.socket.send(bytes(range(250)) * 40)
    port.exchange(device.kernel.now)
    with contextlib.closing(open_client(port)) as second:
        device.wait_for(lambda: hears(second), doing=lambda: port.exchange(device.kernel.now))
        assert second.read(10) == b"cubestack:"
    while len(device.received) < sent:
        before = len(device.received)
        port.exchange(device.advance(MAX_UNSENT))
        assert len(device.received) > before
    assert device.received == (bytes(range(250)) * (sent // 250 + 1))[:sent]


def test_fast_client_is_limited_to_the_line_rate(port, device, connect):
    client = connect()
    sent = bytes(i * 37 % 251 for i in range(100_000))
    position, backlogs = 0, set()

    def serve() -> None:
        nonlocal position
        position += client.write(sent[position:])
        port.exchange(device.advance(500))
        backlogs.add(device.uart.host_backlog)

    device.wait_for(lambda: len(device.received) == len(sent), doing=serve)
    assert device.received == sent
    assert max(backlogs) == MAX_UNSENT


def test_flooding_client_causes_no_wakeups_and_frees_the_port_when_it_dies(
    kind, port, device, connect
):
    first, sent = connect(), 0
    while count := first.write(bytes(1 << 20)):
        sent += count
    device.wait_for(
        lambda: device.uart.host_backlog == MAX_UNSENT,
        doing=lambda: (first.write(bytes(1 << 20)), port.exchange(device.kernel.now)),
    )
    first.write(b"more")
    port.exchange(device.kernel.now)
    assert ready(port) == []
    first.reset()
    assert kind == "pty" or ready(port) == []
    port.exchange(device.kernel.now)
    assert_fresh(port, device, connect())


def test_idle_port_causes_no_wakeups(port, device, connect):
    port.exchange(device.kernel.now)
    assert ready(port) == []
    client = connect()
    port.exchange(device.kernel.now)
    assert ready(port) == []
    client.close()
    wait_ready(port.watched(), TIMEOUT_S)
    assert ready(port) != []  # the end is noticed at once
    port.exchange(device.kernel.now)
    assert ready(port) == []


def test_client_that_never_reads_causes_no_wakeups(port, device, connect):
    connect()
    device.wait_for(lambda: port.congested, doing=lambda: device.sends(port, bytes(1 << 17)))
    device.wait_for(lambda: not ready(port), doing=lambda: port.exchange(device.kernel.now))
    assert port.congested


@a_pty
def test_pty_link_leads_to_a_terminal(port, path):
    assert path.is_symlink()
    with contextlib.closing(open_client(port)) as terminal:
        assert os.isatty(terminal.fd)
    assert port.name == str(path)


@a_pty
def test_pty_delivers_input_of_a_client_that_closed(port, device, connect):
    terminal = connect()
    sent = bytes(i % 251 for i in range(MAX_UNSENT + 3000))
    assert terminal.write(sent) == len(sent)
    port.exchange(device.kernel.now)
    terminal.close()
    assert device.hears(port, len(sent)) == sent


@a_pty
def test_pty_stays_open_while_one_of_two_clients_remains(port, device, connect):
    first, second = connect(), connect()
    device.sends(port, b"kept")
    first.close()
    port.exchange(device.kernel.now)
    assert second.read(4) == b"kept"


def cooked(fd: int) -> None:
    attributes = termios.tcgetattr(fd)
    attributes[tty.IFLAG] |= termios.ICRNL | termios.IXON | termios.ISTRIP
    attributes[tty.OFLAG] |= termios.OPOST | termios.ONLCR
    attributes[tty.LFLAG] |= termios.ICANON | termios.ECHO | termios.ISIG
    attributes[tty.ISPEED] = attributes[tty.OSPEED] = termios.B115200
    termios.tcsetattr(fd, termios.TCSANOW, attributes)


@a_pty
def test_pty_keeps_a_clients_settings_and_is_raw_after_it_left(port, device, connect):
    terminal = connect()
    original = termios.tcgetattr(terminal.fd)
    cooked(terminal.fd)
    assert (chosen := termios.tcgetattr(terminal.fd)) != original
    port.exchange(device.kernel.now)
    assert termios.tcgetattr(terminal.fd) == chosen
    terminal.close()
    port.exchange(device.kernel.now)
    terminal = connect()
    assert termios.tcgetattr(terminal.fd) == original
    assert_transparent(port, device, terminal)


@a_pty
@pytest.mark.parametrize("settings", ["sane", "cooked echo 9600", "raw -echo 115200"])
def test_pty_is_raw_again_after_stty(port, device, path, connect, settings):
    """The program comes and goes between two looks of the scheduler."""
    subprocess.run(["stty", "-F", path, *settings.split()], check=True, timeout=TIMEOUT_S)
    port.exchange(device.kernel.now)
    terminal = connect()
    device.sends(port, ALL_BYTES)
    assert terminal.read(256) == ALL_BYTES
    port.exchange(device.advance(1000))
    assert not device.received  # no echo


def exclusive(fd: int) -> int:
    return int(struct.unpack("i", fcntl.ioctl(fd, TIOCGEXCL, bytes(4)))[0])


@a_pty
def test_pty_exclusive_use_ends_with_the_client(port, device, connect):
    terminal = connect()
    fcntl.ioctl(terminal.fd, termios.TIOCEXCL)
    assert exclusive(terminal.fd)
    terminal.close()
    port.exchange(device.kernel.now)
    assert not exclusive(connect().fd)


def open_slave(path) -> int:
    return os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)


def locked(path) -> bool:
    slave = open_slave(path)
    try:
        return struct.unpack("i", fcntl.ioctl(slave, TIOCGEXCL, bytes(4)))[0] != 0
    finally:
        os.close(slave)


@a_pty
def test_pty_exclusive_use_ends_with_a_client_that_nobody_saw(port, device, path):
    slave = open_slave(path)
    fcntl.ioctl(slave, termios.TIOCEXCL)
    os.close(slave)
    port.exchange(device.kernel.now)
    assert not locked(path)


@a_pty
def test_pty_stopped_output_ends_with_the_client(port, device, path, connect):
    slave = open_slave(path)
    port.exchange(device.kernel.now)
    termios.tcflow(slave, termios.TCOOFF)
    os.close(slave)
    port.exchange(device.kernel.now)
    assert_fresh(port, device, connect())


@pytest.mark.parametrize("own", [False, True], ids=["inherited", "its own"])
def test_pty_client_that_follows_at_once_is_a_new_one(device, path, own):
    reports = []
    port = PtyEndpoint(path, device.uart, report=reports.append)

    def begin(baud) -> int:
        slave = open_slave(path)
        if baud:
            settings = termios.tcgetattr(slave)
            settings[4] = settings[5] = baud
            termios.tcsetattr(slave, termios.TCSANOW, settings)
        os.write(slave, b"?")
        return slave

    try:
        first = begin(termios.B9600)
        port.exchange(device.advance(10))
        device.sends(port, b"for the first")
        os.close(first)
        second = begin(termios.B4800 if own else None)
        port.exchange(device.advance(10))
        assert [
            f"{baud} 8N1" in text for text, baud in zip(reports, (9600, 4800), strict=False)
        ] == ([True, True] if own else [True])
        device.sends(port, b"new")
        assert os.read(second, 100) == b"new"
        baud = termios.tcgetattr(second)[4]
        assert (baud == termios.B4800) if own else (baud == termios.B1000000)
        os.close(second)
    finally:
        port.close()


def test_pty_answers_a_client_that_follows_at_any_line_of_an_exchange(device, path):
    device.answers = 1
    with contextlib.closing(PtyEndpoint(path, device.uart)) as port:
        clients = [open_client(port)]
        port.exchange(device.advance(10))

        def follow() -> None:
            clients.pop().close()
            clients.append(open_client(port))
            clients[0].write(ALL_BYTES)

        moment = 0
        while happens_at_line(moment, follow, lambda: port.exchange(device.advance(10))):
            for _ in range(30):
                port.exchange(device.advance(10))
            assert clients[0].read(len(ALL_BYTES)) == ALL_BYTES, moment
            moment += 1
        assert moment > 20
        clients[0].close()


def happens_at_line(number: int, act: Callable[[], None], call: Callable[[], None]) -> bool:
    """Whether ``call`` comes to its ``number``-th line in the ports; ``act`` is done there."""
    lines = itertools.count()
    done = False

    def trace(frame: FrameType, event: str, _argument: object) -> Any:
        nonlocal done
        if "/emulator/ports/" not in frame.f_code.co_filename:
            return None
        if event == "line" and next(lines) == number:
            done = True
            act()
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        call()
    finally:
        sys.settrace(before)
    return done


@a_pty
def test_pty_that_can_not_be_unlocked_is_replaced(port, device, path, connect, monkeypatch):
    """For a user who is not root, TIOCEXCL of a client that has gone locks everyone out."""
    terminal = connect()
    before = path.readlink()

    def refuse(*_arguments: object) -> int:
        raise OSError(16, "Device or resource busy")

    with monkeypatch.context() as patch:
        terminal.close()
        patch.setattr(os, "open", refuse)
        port.exchange(device.kernel.now)
    assert path.readlink() != before
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
    assert_transparent(port, device, connect())


@pytest.mark.parametrize("kind", ["file", "directory", "link"])
def test_pty_rejects_an_existing_path_and_leaves_the_line_unchanged(device, path, kind):
    if kind == "file":
        path.touch()
    elif kind == "directory":
        path.mkdir()
    else:
        path.symlink_to("/dev/null")
    heard = []
    device.uart.line = lambda data, _first, _step: heard.append(data)
    with pytest.raises(PortError, match=r"pty path '.*ttyTEST' already exists; choose another"):
        PtyEndpoint(path, device.uart)
    device.uart.send(b"x")
    assert heard == [b"x"]


def test_pty_path_without_a_folder_raises_port_error(device, tmp_path):
    with pytest.raises(PortError, match="nowhere/ttyTEST: No such file or directory"):
        PtyEndpoint(tmp_path / "nowhere" / "ttyTEST", device.uart)


def test_pty_replaces_a_stale_link_and_removes_only_its_own(device, path):
    path.symlink_to("/dev/pts/987654")
    endpoint = PtyEndpoint(path, device.uart)
    assert os.path.realpath(path) != "/dev/pts/987654"
    endpoint.close()
    assert not path.is_symlink()
    endpoint = PtyEndpoint(path, device.uart)
    path.unlink()
    path.write_text("somebody else's")
    endpoint.close()
    assert path.read_text() == "somebody else's"


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
