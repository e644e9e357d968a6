"""The pseudo-terminal against real programs, with every look of the scheduler made by the test."""

import contextlib
import fcntl
import os
import struct
import subprocess
import termios
import tty

import pytest

from cubestack.emulator.ports.endpoint import PortError, poll_now
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.ports.realtime import wait_ready
from cubestack.emulator.ports.serial_port import MAX_UNSENT

ALL_BYTES = bytes(range(256))
STTY_TIMEOUT_S = 20.0
TIOCGEXCL = 0x80045440  # linux/asm-generic/ioctls.h; termios has the setters only


def ready(port: PtyEndpoint) -> list[int]:
    """Which of the port's descriptors would wake the scheduler at once."""
    return [fd for fd, events in port.watched() if poll_now(fd, events)]


def test_pty_link_leads_to_a_terminal(pty, path, terminal_at):
    assert path.is_symlink()
    with contextlib.closing(terminal_at(path)) as terminal:
        assert os.isatty(terminal.fd)
    assert pty.name == str(path)


def test_pty_is_transparent_both_ways(pty, device, open_terminal):
    terminal = open_terminal()
    device.sends(pty, ALL_BYTES)
    assert terminal.read(256) == ALL_BYTES
    terminal.write(ALL_BYTES)
    assert device.hears(pty, 256) == ALL_BYTES


@pytest.mark.parametrize("unread", [1, 100, 60_000, 200_000])
def test_pty_client_gets_nothing_that_the_one_before_left(pty, device, open_terminal, unread):
    first = open_terminal()
    for _ in range(0, unread, 1000):
        device.sends(pty, b"stale" * 200)
    first.close()
    pty.exchange(device.kernel.now)
    second = open_terminal()
    device.sends(pty, b"fresh")
    assert second.read(5) == b"fresh"


def test_pty_output_without_a_client_is_dropped(pty, device, open_terminal):
    device.sends(pty, b"stale")
    terminal = open_terminal()
    device.sends(pty, b"fresh")
    assert terminal.read(5) == b"fresh"


def test_pty_input_of_a_client_that_closes_at_once_arrives(pty, device, path, terminal_at):
    with contextlib.closing(terminal_at(path)) as terminal:
        terminal.write(b"last words")
    assert device.hears(pty, 10) == b"last words"


def test_pty_input_survives_the_tidying_after_its_client(pty, device, open_terminal):
    terminal = open_terminal()
    sent = bytes(i % 251 for i in range(MAX_UNSENT + 3000))
    assert terminal.write(sent) == len(sent)
    pty.exchange(device.kernel.now)
    terminal.close()
    assert device.hears(pty, len(sent)) == sent


def test_pty_stays_open_while_one_of_two_clients_has_it(pty, device, open_terminal):
    first, second = open_terminal(), open_terminal()
    device.sends(pty, b"kept")
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

    device.wait_for(lambda: len(device.received) == len(sent), doing=serve)
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
    device.sends(pty, ALL_BYTES)
    assert terminal.read(256) == ALL_BYTES
    terminal.write(ALL_BYTES)
    assert device.hears(pty, 256) == ALL_BYTES


@pytest.mark.parametrize("settings", ["sane", "cooked echo 9600", "raw -echo 115200"])
def test_pty_is_raw_again_after_stty(pty, device, path, open_terminal, settings):
    """The program comes and goes between two looks of the scheduler."""
    subprocess.run(["stty", "-F", path, *settings.split()], check=True, timeout=STTY_TIMEOUT_S)
    pty.exchange(device.kernel.now)
    terminal = open_terminal()
    device.sends(pty, ALL_BYTES)
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
    device.sends(pty, ALL_BYTES)
    assert terminal.read(256) == ALL_BYTES
    terminal.write(b"hello")
    assert device.hears(pty, 5) == b"hello"


def test_pty_without_a_client_wakes_nobody(pty, device, open_terminal):
    pty.exchange(device.kernel.now)
    assert ready(pty) == []
    open_terminal().close()
    assert ready(pty) != []  # the end is noticed at once
    pty.exchange(device.kernel.now)
    assert ready(pty) == []


def test_pty_client_that_never_reads_wakes_nobody(pty, device, open_terminal):
    open_terminal()
    device.wait_for(lambda: pty.congested, doing=lambda: device.sends(pty, bytes(10_000)))
    device.wait_for(lambda: not ready(pty), doing=lambda: pty.exchange(device.kernel.now))
    assert pty.congested


def test_pty_client_that_writes_too_fast_wakes_nobody(pty, device, open_terminal):
    terminal = open_terminal()
    terminal.write(bytes(MAX_UNSENT))
    device.wait_for(
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
