"""The device node /dev/i2c-N: the paths that name it, and its file status."""

import os
import re
import stat
import struct
from collections.abc import Callable
from enum import Enum, auto

I2C_MAJOR = 89
"""Device number of Linux's I2C devices; the minor number is the bus."""

LISTING = "/proc/bus/i2c"
"""The file in which i2c-tools look for busses first; kernels since 2.6 do not have it."""

MODE = stat.S_IFCHR | 0o660
PAGE_BYTES = 4096
AT_FDCWD = -100
MAX_LINKS = 40
"""Symbolic links in a path, as in Linux; with more it is ELOOP."""

_OWN_FD = re.compile(r"(/proc/(?:self|thread-self)/fd|/dev/fd)/(\d+)")
_FD = re.compile(r"/proc/(\d+)/(?:task/\d+/)?fd/(\d+)")
_STREAMS = {"/dev/stdin": 0, "/dev/stdout": 1, "/dev/stderr": 2}
_BASIC_STATX = 0x07FF
DT_CHR = 2
ENTRY_HEAD = struct.Struct("=QqHB")
"""Of struct linux_dirent64: inode, offset of the next one, length, type; the name follows."""


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

    def find(
        self,
        path: str,
        pid: int,
        folder: int | None,
        *,
        follow: bool = True,
        is_ours: Callable[[int, int], bool] = lambda _pid, _fd: False,
    ) -> Found | None:
        """The emulated file that ``path`` names in process ``pid``, or None.

        Args:
            path: the path; also a symbolic link to the device file, or an opened one in /proc.
            pid: the process.
            folder: descriptor at which a relative path starts; None and AT_FDCWD: working folder.
            follow: whether the call follows a link at the end of the path.
            is_ours: whether a descriptor of a process is an opened device file.
        """
        if path == LISTING:
            return Found.LISTING
        start = "cwd" if folder in (None, AT_FDCWD) else f"fd/{folder}"
        for _ in range(MAX_LINKS):
            path = _of_process(path, pid)
            if not path.startswith("/"):
                path = f"/proc/{pid}/{start}/{path}"
            head, tail = os.path.split(path)
            if tail == self._name and os.path.realpath(head) == "/dev":
                return Found.DEVICE
            if not follow:
                return None
            if opened := _FD.fullmatch(path):
                return Found.DEVICE if is_ours(int(opened[1]), int(opened[2])) else None
            try:
                path = os.path.join(head, os.readlink(path))
            except OSError:  # no link, or nothing there
                return None
        return None

    def is_own_link(self, path: str, pid: int, is_ours: Callable[[int, int], bool]) -> bool:
        """Whether ``path`` is the link in /proc to an opened device file."""
        opened = _FD.fullmatch(_of_process(path, pid))
        return opened is not None and is_ours(int(opened[1]), int(opened[2]))

    def entry(self, after: int) -> bytes:
        """The device file as a struct linux_dirent64, behind an entry of offset ``after``."""
        name = self._name.encode() + b"\0"
        length = -(-(ENTRY_HEAD.size + len(name)) // 8) * 8
        head = ENTRY_HEAD.pack(self._place()[1], after, length, DT_CHR)
        return (head + name).ljust(length, b"\0")

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


def _of_process(path: str, pid: int) -> str:
    """``path`` as this process sees it, if it names descriptors of process ``pid`` itself."""
    if path in _STREAMS:
        return f"/proc/{pid}/fd/{_STREAMS[path]}"
    own = _OWN_FD.fullmatch(path)
    return f"/proc/{pid}/fd/{own[2]}" if own else path
