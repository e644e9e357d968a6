"""What tests of the ports share: kinds of port, and what a client must see."""

import fcntl
import select
import struct
import termios

import pytest

from .conftest import ALL_BYTES

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
