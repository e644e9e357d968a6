"""The name /dev/i2c-N: which paths mean it, and what a program sees that looks at it."""

import os
import stat
import struct
from enum import Enum, auto

I2C_MAJOR = 89
"""Device number of Linux's I2C devices; the minor number is the bus."""

LISTING = "/proc/bus/i2c"
"""Where i2c-tools look for the busses first; no kernel of this century has that file."""

MODE = stat.S_IFCHR | 0o660
PAGE_BYTES = 4096
AT_FDCWD = -100
_BASIC_STATX = 0x07FF


class Found(Enum):
    """What a path means."""

    DEVICE = auto()
    LISTING = auto()


class DeviceNode:
    """A device file that is not there.

    Attributes:
        bus: its number.
        path: its path.
        listing: text that lists it, for i2c-tools.
    """

    def __init__(self, bus: int) -> None:
        """Name bus number ``bus``."""
        self.bus = bus
        self.path = f"/dev/i2c-{bus}"
        self.listing = f"i2c-{bus}\ti2c       \tcubestack emulated bus            \tI2C adapter\n"
        self._name = f"i2c-{bus}"

    def may_be(self, path: str) -> bool:
        """Whether ``path`` ends as ours does, so that ``find`` is worth the effort."""
        return path.endswith(self._name) or path == LISTING

    def find(self, path: str, pid: int, folder: int | None) -> Found | None:
        """What ``path`` means to process ``pid``; a relative one starts at descriptor ``folder``.

        None for ``folder``, or AT_FDCWD, is the process's working folder.
        """
        if path == LISTING:
            return Found.LISTING
        if not path.startswith("/"):
            start = "cwd" if folder in (None, AT_FDCWD) else f"fd/{folder}"
            try:
                path = os.path.join(os.readlink(f"/proc/{pid}/{start}"), path)
            except OSError:
                return None
        head, tail = os.path.split(path)
        if tail == self._name and os.path.realpath(head) == "/dev":
            return Found.DEVICE
        return None

    def stat(self, *, compact: bool) -> bytes:
        """A struct stat; ``compact`` as in asm-generic/stat.h, else that of x86-64."""
        device = os.makedev(I2C_MAJOR, self.bus)
        dev, inode, owner, group = self._place()
        if compact:
            head = struct.pack("=QQIIIIQQ", dev, inode, MODE, 1, owner, group, device, 0)
            return head + struct.pack("=qiiq", 0, PAGE_BYTES, 0, 0) + bytes(7 * 8)
        head = struct.pack("=QQQIIIIQ", dev, inode, 1, MODE, owner, group, 0, device)
        return head + struct.pack("=qqq", 0, PAGE_BYTES, 0) + bytes(9 * 8)

    def statx(self) -> bytes:
        """A struct statx."""
        dev, inode, owner, group = self._place()
        head = struct.pack("=IIQIII", _BASIC_STATX, PAGE_BYTES, 0, 1, owner, group)
        size = struct.pack("=HHQQQQ", MODE, 0, inode, 0, 0, 0)
        times = bytes(4 * 16)
        numbers = struct.pack("=IIII", I2C_MAJOR, self.bus, os.major(dev), os.minor(dev))
        return (head + size + times + numbers).ljust(256, b"\0")

    def _place(self) -> tuple[int, int, int, int]:
        """Device and inode, made up beside those of /dev, and the owner: whoever runs this."""
        return os.stat("/dev").st_dev, (1 << 31) + self.bus, os.getuid(), os.getgid()
