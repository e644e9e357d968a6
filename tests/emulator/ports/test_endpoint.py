"""The ports against real clients: files, sockets, pyserial and stty.

Most tests call ``exchange`` themselves, so that who was first is certain. Those at the end let
the pump serve in a thread. Clients block with a timeout; nothing sleeps.
"""

import contextlib
import fcntl
import os
import select
import socket
import struct
import subprocess
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import serial

from cubestack.emulator.ports.endpoint import PortError, PtyEndpoint, TcpEndpoint
from cubestack.emulator.ports.pump import Pump, wait_ready
from cubestack.emulator.ports.serial_port import MAX_UNSENT, poll_now

TIMEOUT_S = 20.0  # of a client that waits for what must come
ALL_BYTES = bytes(range(256))
LOOPBACK = "127.0.0.1"
TIOCGEXCL = 0x80045440  # linux/asm-generic/ioctls.h; termios has the setters only


def wait_for(condition: Callable[[], object], *, doing: Callable[[], object]) -> None:
    """Do something that blocks for a moment at most, until the condition holds."""
    deadline = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline
        doing()


def ready(port: PtyEndpoint | TcpEndpoint) -> list[tuple[int, int]]:
    """Which of the port's descriptors would wake the pump at once."""
    return [(fd, events) for fd, events in port.watched() if poll_now(fd, events)]


# --- pseudo-terminal ---------------------------------------------------------------------------


class Terminal:
    """A program with the slave open, without blocking."""

    def __init__(self, path: Path) -> None:
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            assert select.select([self.fd], [], [], TIMEOUT_S)[0], f"only {len(data)} bytes came"
            data += os.read(self.fd, count - len(data))
        return data

    def write(self, data: bytes) -> int:
        try:
            return os.write(self.fd, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        os.close(self.fd)


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "ttyTEST"


@pytest.fixture
def pty(device, path) -> Iterator[PtyEndpoint]:
    endpoint = PtyEndpoint(path, device.uart)
    yield endpoint
    endpoint.close()


@pytest.fixture
def open_terminal(pty, device, path) -> Iterator[Callable[[], Terminal]]:
    """Opens the slave and lets the port notice."""
    opened: list[Terminal] = []

    def open_one() -> Terminal:
        opened.append(Terminal(path))
        pty.exchange(device.kernel.now)
        return opened[-1]

    yield open_one
    for terminal in opened:
        with contextlib.suppress(OSError):
            terminal.close()


def device_sends(port: PtyEndpoint | TcpEndpoint, device: Any, data: bytes) -> None:
    device.uart.send(data)
    port.exchange(device.advance(len(data)))


def device_hears(port: PtyEndpoint | TcpEndpoint, device: Any, count: int) -> bytes:
    """Serve until so many bytes have come to the device."""
    wait_for(
        lambda: len(device.received) >= count,
        doing=lambda: (wait_ready(port.watched(), 0.01), port.exchange(device.advance(100))),
    )
    return bytes(device.received)


def test_pty_link_leads_to_a_terminal(pty, path):
    assert path.is_symlink()
    with contextlib.closing(Terminal(path)) as terminal:
        assert os.isatty(terminal.fd)
    assert pty.name == str(path)


def test_pty_is_transparent_both_ways(pty, device, open_terminal):
    terminal = open_terminal()
    device_sends(pty, device, ALL_BYTES)
    assert terminal.read(256) == ALL_BYTES
    terminal.write(ALL_BYTES)
    assert device_hears(pty, device, 256) == ALL_BYTES


@pytest.mark.parametrize("unread", [1, 100, 60_000, 200_000])
def test_pty_client_gets_nothing_that_the_one_before_left(pty, device, open_terminal, unread):
    first = open_terminal()
    for _ in range(0, unread, 1000):
        device_sends(pty, device, b"stale" * 200)
    first.close()
    pty.exchange(device.kernel.now)
    second = open_terminal()
    device_sends(pty, device, b"fresh")
    assert second.read(5) == b"fresh"


def test_pty_output_without_a_client_is_dropped(pty, device, open_terminal):
    device_sends(pty, device, b"stale")
    terminal = open_terminal()
    device_sends(pty, device, b"fresh")
    assert terminal.read(5) == b"fresh"


def test_pty_input_of_a_client_that_closes_at_once_arrives(pty, device, path):
    with contextlib.closing(Terminal(path)) as terminal:
        terminal.write(b"last words")
    assert device_hears(pty, device, 10) == b"last words"


def test_pty_input_survives_the_tidying_after_its_client(pty, device, open_terminal):
    terminal = open_terminal()
    sent = bytes(i % 251 for i in range(MAX_UNSENT + 3000))
    assert terminal.write(sent) == len(sent)
    pty.exchange(device.kernel.now)
    terminal.close()
    assert device_hears(pty, device, len(sent)) == sent


def test_pty_stays_open_while_one_of_two_clients_has_it(pty, device, open_terminal):
    first, second = open_terminal(), open_terminal()
    device_sends(pty, device, b"kept")
    first.close()
    pty.exchange(device.kernel.now)
    assert second.read(4) == b"kept"


def test_pty_client_can_not_flood_the_line(pty, device, open_terminal):
    terminal = open_terminal()
    sent = bytes(i * 37 % 251 for i in range(100_000))
    position = 0

    def serve() -> None:
        nonlocal position
        position += terminal.write(sent[position:])
        pty.exchange(device.advance(500))
        assert device.uart.host_backlog <= MAX_UNSENT

    wait_for(lambda: len(device.received) == len(sent), doing=serve)
    assert device.received == sent


def cooked(fd: int) -> None:
    attributes = termios.tcgetattr(fd)
    attributes[tty.IFLAG] |= termios.ICRNL | termios.IXON | termios.ISTRIP
    attributes[tty.OFLAG] |= termios.OPOST | termios.ONLCR
    attributes[tty.LFLAG] |= termios.ICANON | termios.ECHO | termios.ISIG
    attributes[tty.ISPEED] = attributes[tty.OSPEED] = termios.B115200
    termios.tcsetattr(fd, termios.TCSANOW, attributes)


def test_pty_is_raw_again_after_a_client_that_changed_it(pty, device, open_terminal):
    terminal = open_terminal()
    original = termios.tcgetattr(terminal.fd)
    cooked(terminal.fd)
    assert termios.tcgetattr(terminal.fd) != original
    terminal.close()
    pty.exchange(device.kernel.now)
    terminal = open_terminal()
    assert termios.tcgetattr(terminal.fd) == original
    device_sends(pty, device, ALL_BYTES)
    assert terminal.read(256) == ALL_BYTES
    terminal.write(ALL_BYTES)
    assert device_hears(pty, device, 256) == ALL_BYTES


@pytest.mark.parametrize("settings", ["sane", "cooked echo 9600", "raw -echo 115200"])
def test_pty_is_raw_again_after_stty(pty, device, path, open_terminal, settings):
    """The program comes and goes between two looks of the pump."""
    subprocess.run(["stty", "-F", path, *settings.split()], check=True, timeout=TIMEOUT_S)
    pty.exchange(device.kernel.now)
    terminal = open_terminal()
    device_sends(pty, device, ALL_BYTES)
    assert terminal.read(256) == ALL_BYTES
    pty.exchange(device.advance(1000))
    assert not device.received  # no echo


def test_pty_leaves_a_client_its_settings(pty, device, open_terminal):
    terminal = open_terminal()
    cooked(terminal.fd)
    chosen = termios.tcgetattr(terminal.fd)
    pty.exchange(device.kernel.now)
    assert termios.tcgetattr(terminal.fd) == chosen


def exclusive(fd: int) -> int:
    return int(struct.unpack("i", fcntl.ioctl(fd, TIOCGEXCL, bytes(4)))[0])


def test_pty_exclusive_use_ends_with_the_client(pty, device, open_terminal):
    terminal = open_terminal()
    fcntl.ioctl(terminal.fd, termios.TIOCEXCL)
    assert exclusive(terminal.fd)
    terminal.close()
    pty.exchange(device.kernel.now)
    assert not exclusive(open_terminal().fd)


def test_pty_that_can_not_be_unlocked_is_replaced(pty, device, path, open_terminal, monkeypatch):
    """For a user who is not root, TIOCEXCL of a client that has gone locks everyone out."""
    terminal = open_terminal()
    before = path.readlink()

    def refuse(*_arguments: object) -> int:
        raise OSError(16, "Device or resource busy")

    with monkeypatch.context() as patch:
        terminal.close()
        patch.setattr(os, "open", refuse)
        pty.exchange(device.kernel.now)
    assert path.readlink() != before
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
    terminal = open_terminal()
    device_sends(pty, device, ALL_BYTES)
    assert terminal.read(256) == ALL_BYTES
    terminal.write(b"hello")
    assert device_hears(pty, device, 5) == b"hello"


def test_pty_without_a_client_wakes_nobody(pty, device, open_terminal):
    pty.exchange(device.kernel.now)
    assert ready(pty) == []
    open_terminal().close()
    assert ready(pty) != []  # the end is noticed at once
    pty.exchange(device.kernel.now)
    assert ready(pty) == []


def test_pty_client_that_never_reads_wakes_nobody(pty, device, open_terminal):
    open_terminal()
    wait_for(lambda: pty.congested, doing=lambda: device_sends(pty, device, bytes(10_000)))
    wait_for(lambda: not ready(pty), doing=lambda: pty.exchange(device.kernel.now))
    assert pty.congested


def test_pty_client_that_writes_too_fast_wakes_nobody(pty, device, open_terminal):
    terminal = open_terminal()
    terminal.write(bytes(MAX_UNSENT))
    wait_for(
        lambda: device.uart.host_backlog == MAX_UNSENT,
        doing=lambda: (wait_ready(pty.watched(), 0.01), pty.exchange(device.kernel.now)),
    )
    terminal.write(b"more")
    pty.exchange(device.kernel.now)
    assert ready(pty) == []


@pytest.mark.parametrize("kind", ["file", "directory", "link"])
def test_pty_takes_no_path_that_exists(device, path, kind):
    if kind == "file":
        path.touch()
    elif kind == "directory":
        path.mkdir()
    else:
        path.symlink_to("/dev/null")
    with pytest.raises(PortError, match="ttyTEST exists already: choose another --pty path"):
        PtyEndpoint(path, device.uart)


def test_pty_path_in_no_directory(device, tmp_path):
    with pytest.raises(PortError, match="nowhere/ttyTEST: No such file or directory"):
        PtyEndpoint(tmp_path / "nowhere" / "ttyTEST", device.uart)


def test_pty_replaces_the_link_of_a_run_that_died(device, path):
    path.symlink_to("/dev/pts/987654")
    endpoint = PtyEndpoint(path, device.uart)
    assert os.path.realpath(path) != "/dev/pts/987654"
    endpoint.close()


def test_pty_that_can_not_open_leaves_the_line_alone(device, path):
    path.touch()
    heard = []
    device.uart.line = lambda data, _first, _step: heard.append(data)
    with pytest.raises(PortError):
        PtyEndpoint(path, device.uart)
    device.uart.send(b"x")
    assert heard == [b"x"]


def test_pty_close_removes_its_own_link_only(device, path):
    endpoint = PtyEndpoint(path, device.uart)
    endpoint.close()
    assert not path.is_symlink()
    endpoint = PtyEndpoint(path, device.uart)
    path.unlink()
    path.write_text("somebody else's")
    endpoint.close()
    assert path.read_text() == "somebody else's"


# --- TCP ---------------------------------------------------------------------------------------


@pytest.fixture
def tcp(device) -> Iterator[TcpEndpoint]:
    endpoint = TcpEndpoint(LOOPBACK, 0, device.uart)
    yield endpoint
    endpoint.close()


@pytest.fixture
def connect(tcp, device) -> Iterator[Callable[[], socket.socket]]:
    """Connects and lets the port notice."""
    opened: list[socket.socket] = []

    def connect_one() -> socket.socket:
        opened.append(socket.create_connection(tcp.address, TIMEOUT_S))
        wait_ready(tcp.watched(), TIMEOUT_S)
        tcp.exchange(device.kernel.now)
        return opened[-1]

    yield connect_one
    for client in opened:
        client.close()


def receive(client: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        part = client.recv(count - len(data))
        assert part, f"closed after {len(data)} bytes"
        data += part
    return data


def reset(client: socket.socket) -> None:
    """Die: the connection is torn down without a word."""
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.close()


def end(client: socket.socket) -> None:
    client.close()


def test_tcp_is_transparent_both_ways(tcp, device, connect):
    client = connect()
    device_sends(tcp, device, ALL_BYTES)
    assert receive(client, 256) == ALL_BYTES
    client.sendall(ALL_BYTES)
    assert device_hears(tcp, device, 256) == ALL_BYTES


def test_tcp_name_tells_how_to_open_it(tcp):
    assert tcp.name == f"tcp://127.0.0.1:{tcp.address[1]}"


def test_tcp_port_that_is_taken(tcp, device):
    with pytest.raises(PortError, match=r"can not listen on 127\.0\.0\.1:\d+: .*another port"):
        TcpEndpoint(LOOPBACK, tcp.address[1], device.uart)


def test_tcp_port_is_free_after_close(device):
    first = TcpEndpoint(LOOPBACK, 0, device.uart)
    client = socket.create_connection(first.address, TIMEOUT_S)
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
    assert b"has a client already" in receive(second, 43)
    assert second.recv(1) == b""
    device_sends(tcp, device, b"mine")
    assert receive(first, 4) == b"mine"


@pytest.mark.parametrize("leave", [end, reset])
def test_tcp_client_that_reconnects_at_once_is_served(tcp, device, leave):
    """Both happen before the port gets a look in."""
    address = tcp.address
    for round_ in range(5):
        client = socket.create_connection(address, TIMEOUT_S)
        wait_ready(tcp.watched(), TIMEOUT_S)
        tcp.exchange(device.kernel.now)
        answer = b"round %d" % round_
        device_sends(tcp, device, answer)
        assert receive(client, 7) == answer
        device_sends(tcp, device, b"never read")
        leave(client)


@pytest.mark.parametrize("leave", [end, reset])
def test_tcp_client_gets_nothing_that_the_one_before_left(tcp, device, connect, leave):
    first = connect()
    device_sends(tcp, device, bytes(500_000))
    leave(first)
    second = connect()
    device_sends(tcp, device, b"fresh")
    assert receive(second, 5) == b"fresh"


def test_tcp_client_that_has_sent_all_still_gets_the_answer(tcp, device, connect):
    device.echoes = True
    client = connect()
    client.sendall(b"question")
    client.shutdown(socket.SHUT_WR)
    assert device_hears(tcp, device, 8) == b"question"
    tcp.exchange(device.advance(20))
    assert receive(client, 8) == b"question"


@pytest.mark.parametrize("leave", [end, reset])
def test_tcp_client_that_dies_in_mid_frame(tcp, device, connect, leave):
    first = connect()
    first.sendall(b"half a fra")
    assert device_hears(tcp, device, 10) == b"half a fra"
    leave(first)
    for _ in range(3):
        device_sends(tcp, device, b"to nobody")
    second = connect()
    second.sendall(b"whole")
    assert device_hears(tcp, device, 15) == b"half a frawhole"
    device_sends(tcp, device, b"fresh")
    assert receive(second, 5) == b"fresh"


def test_tcp_client_that_floods_and_dies_makes_room(tcp, device, connect):
    first = connect()
    first.setblocking(False)
    sent = 0
    with contextlib.suppress(BlockingIOError):
        while True:
            sent += first.send(bytes(1 << 20))
    tcp.exchange(device.kernel.now)
    assert device.uart.host_backlog == MAX_UNSENT < sent
    assert ready(tcp) == []
    reset(first)
    assert ready(tcp) == []
    second = connect()
    device_sends(tcp, device, b"fresh")
    assert receive(second, 5) == b"fresh"


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
    wait_for(lambda: tcp.congested, doing=lambda: device_sends(tcp, device, bytes(1 << 20)))
    wait_for(lambda: not ready(tcp), doing=lambda: tcp.exchange(device.kernel.now))
    assert tcp.congested


def test_tcp_close_drops_the_client(device):
    endpoint = TcpEndpoint(LOOPBACK, 0, device.uart)
    with socket.create_connection(endpoint.address, TIMEOUT_S) as client:
        endpoint.exchange(0)
        endpoint.close()
        assert client.recv(1) == b""


# --- served by the pump ------------------------------------------------------------------------


@contextlib.contextmanager
def served(device: Any, endpoint: PtyEndpoint | TcpEndpoint, pace: Any) -> Iterator[None]:
    pump = Pump(device.kernel, [endpoint], lambda: device.uart.busy, pace=pace)
    thread = threading.Thread(target=pump.run)
    thread.start()
    try:
        yield
    finally:
        pump.stop()
        thread.join(TIMEOUT_S)
        assert not thread.is_alive()


@pytest.mark.parametrize("pace", ["real", "fast"])
def test_pyserial_on_a_pty(pty, device, path, pace):
    device.echoes = True
    with served(device, pty, pace):
        for round_ in range(3):
            with serial.Serial(str(path), 57600, timeout=TIMEOUT_S, exclusive=True) as client:
                message = ALL_BYTES + bytes([round_])
                client.write(message)
                assert client.read(len(message)) == message


@pytest.mark.parametrize("pace", ["real", "fast"])
def test_pyserial_over_tcp(tcp, device, pace):
    device.echoes = True
    url = f"socket://{tcp.address[0]}:{tcp.address[1]}"
    with served(device, tcp, pace):
        for round_ in range(3):
            with serial.serial_for_url(url, timeout=TIMEOUT_S) as client:
                message = ALL_BYTES + bytes([round_])
                client.write(message)
                assert client.read(len(message)) == message


@pytest.mark.parametrize("pace", ["real", "fast"])
def test_plain_file_on_a_pty(pty, device, path, pace):
    device.echoes = True
    with served(device, pty, pace), contextlib.closing(Terminal(path)) as terminal:
        terminal.write(ALL_BYTES)
        assert terminal.read(256) == ALL_BYTES


@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_fast_pace_loses_nothing_to_a_client_slower_than_the_emulator(kind, request, device):
    """Virtual time waits for it: 400 kB come while it reads a few bytes at a time."""
    port = request.getfixturevalue(kind)
    sent = bytes(i * 37 % 251 for i in range(400_000))
    device.uart.on_byte = lambda _byte: device.uart.send(sent)
    with served(device, port, "fast"), contextlib.ExitStack() as stack:
        if kind == "pty":
            terminal = stack.enter_context(contextlib.closing(Terminal(Path(port.name))))
            terminal.write(b"?")
            received = terminal.read(len(sent))
        else:
            client = socket.create_connection(port.address, TIMEOUT_S)
            stack.enter_context(client)
            client.sendall(b"?")
            received = receive(client, len(sent))
    assert received == sent
