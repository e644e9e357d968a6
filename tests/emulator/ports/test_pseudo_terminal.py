"""Pseudo-terminals against real programs."""

import contextlib
import fcntl
import itertools
import os
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
from cubestack.emulator.ports.pseudo_terminal import PtyEndpoint
from cubestack.emulator.ports.serial_port import MAX_UNSENT

from .checks import TIOCGEXCL, a_pty, assert_fresh, assert_transparent
from .conftest import ALL_BYTES, TIMEOUT_S, open_client


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
