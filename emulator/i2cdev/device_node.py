"""The device node /dev/i2c-N: the paths that name it, and its file status."""

import os
import stat
import struct
from enum import Enum, auto

I2C_MAJOR = 89
"""Device number of Linux's I2C devices; the minor number is the bus."""

LISTING = "/proc/bus/i2c"
"""The file in which i2c-tools look for busses first; kernels since 2.6 do not have it."""

MODE = stat.S_IFCHR | 0o660
PAGE_BYTES = 4096
AT_FDCWD = -100
_BASIC_STATX = 0x07FF


class Found(Enum):
    """The emulated file that a path names."""

    DEVICE = auto()
    LISTING = auto()


class DeviceNode:
    """A device file that does not exist in the file system.

    Attributes:
        bus: number of the bus.
        path: path of the device file.
        listing: content of ``LISTING``, for i2c-tools.
    """

    def __init__(self, bus: int) -> None:
        self.bus = bus
        self.path = f"/dev/i2c-{bus}"
        self.listing = f"i2c-{bus}\ti2c       \tcubestack emulated bus            \tI2C adapter\n"
        self._name = f"i2c-{bus}"

    def may_match(self, path: str) -> bool:
        """Whether ``path`` may name an emulated file; a fast check before ``find``."""
        return path.endswith(self._name) or path == LISTING

    def find(self, path: str, pid: int, folder: int | None) -> Found | None:
        """The emulated file that ``path`` names in process ``pid``, or None.

        A relative path starts at descriptor ``folder``; None and AT_FDCWD mean the working folder.
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
        """A struct stat; ``compact``: as in asm-generic/stat.h, else as on x86-64."""
        device = os.makedev(I2C_MAJOR, self.bus)
        dev, inode, owner, group = self._place()
        if compact:
            head = struct.pack("=QQIIIIQQ", dev, inode, MODE, 1, owner, group, device, 0)
            return head + struct.pack("=qiiq", 0, PAGE_BYTES, 0, 0) + bytes(7 * 8)
        head = struct.pack("=QQQIIIIQ", dev, inode, 1, MODE, owner, group, 0, device)
        return head + struct.pack("=qqq", 0, PAGE_BYTES, 0) + bytes(9 * 8)

    def statx(self) -> bytes:
        dev, inode, owner, group = self._place()
        head = struct.pack("=IIQIII", _BASIC_STATX, PAGE_BYTES, 0, 1, owner, group)
        size = struct.pack("=HHQQQQ", MODE, 0, inode, 0, 0, 0)
        times = bytes(4 * 16)
        numbers = struct.pack("=IIII", I2C_MAJOR, self.bus, os.major(dev), os.minor(dev))
        return (head + size + times + numbers).ljust(256, b"\0")

    def _place(self) -> tuple[int, int, int, int]:
        """Device and inode, which continue those of /dev, and the owner: this process's user."""
        return os.stat("/dev").st_dev, (1 << 31) + self.bus, os.getuid(), os.getgid()
