"""The seccomp filter that sends a program's calls to its supervisor, as classic BPF.

It sends only calls that may concern the device file: those with a path, the ioctl requests of
Linux's I2C devices, and reads, writes and their like on descriptors from ``FIRST`` on. All others
run at full speed. io_uring would bypass the filter, so it does not exist for the program.
"""

import errno
import struct
from collections.abc import Iterable

from cubestack.emulator.i2cdev.seccomp.abi import Abi
from cubestack.firmware_model.formats.linux_i2c import Ioctl

FIRST = 3
"""Lowest descriptor of a device file. The standard streams stay at full speed."""

AT_EMPTY_PATH = 0x1000
EPOLL_CTL_ADD = 1
F_DUPFD = 0
F_GETFL = 3
F_DUPFD_CLOEXEC = 1030

FIONREAD, TIOCOUTQ, FIOASYNC = 0x541B, 0x5411, 0x5452
SOCKET_REQUESTS = range(0x8900, 0x8A00)
"""Requests of ioctl that sockets have, and device files have not."""

ON_PATH = (
    *("open", "creat", "openat", "openat2", "stat", "lstat", "newfstatat", "statx"),
    *("access", "faccessat", "faccessat2", "readlink", "readlinkat"),
    *("getxattr", "lgetxattr"),
)
ON_DESCRIPTOR = (
    *("read", "write", "readv", "writev", "pread64", "pwrite64"),
    *("preadv", "pwritev", "preadv2", "pwritev2", "fstat", "dup", "getdents64"),
)
ALWAYS = ("sendfile", "splice", "copy_file_range")
"""Calls on two descriptors; they are rare."""

_RET_ALLOW = 0x7FFF_0000
_RET_NOTIFY = 0x7FC0_0000
_RET_ERRNO = 0x0005_0000
_X32_BIT = 0x4000_0000
_NEGATIVE = 0x8000_0000

_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_NUMBER, _ARCH, _ARGUMENT = 0, 4, 16

Step = tuple[int, int, str, str]  # code, operand, label if true, label if false; "": next step


def make_filter(abi: Abi) -> bytes:
    """The filter program, as an array of struct sock_filter."""
    steps: list[Step | str] = [
        (_LOAD, _ARCH, "", ""),
        (_EQUAL, abi.audit_arch, "", "allow"),
        (_LOAD, _NUMBER, "", ""),
        (_AT_LEAST, _X32_BIT, "allow", ""),
    ]
    steps += _jumps(("ioctl",), abi, "ioctl")
    steps += _jumps(ON_DESCRIPTOR, abi, "descriptor")
    steps += _jumps(("fcntl",), abi, "fcntl")
    steps += _jumps(("newfstatat",), abi, "empty path")
    steps += _jumps(("epoll_ctl",), abi, "epoll")
    steps += _jumps(("dup2", "dup3"), abi, "duplicate")
    steps += _jumps(("io_uring_setup",), abi, "missing")
    steps += _jumps((*ON_PATH, *ALWAYS), abi, "notify")
    steps += ["allow", (_RETURN, _RET_ALLOW, "", "")]
    steps += ["missing", (_RETURN, _RET_ERRNO | errno.ENOSYS, "", "")]
    steps += ["ioctl", (_LOAD, _low(1), "", "")]
    steps += [(_EQUAL, number, "notify", "") for number in Ioctl]
    steps += [(_EQUAL, number, "descriptor", "") for number in (FIONREAD, TIOCOUTQ, FIOASYNC)]
    steps += [(_AT_LEAST, SOCKET_REQUESTS.stop, "allow 2", "")]
    steps += [(_AT_LEAST, SOCKET_REQUESTS.start, "descriptor", "allow 2")]
    steps += ["fcntl", (_LOAD, _low(1), "", "")]
    steps += [(_EQUAL, F_GETFL, "descriptor", "")]
    steps += [(_EQUAL, F_DUPFD, "lowest", ""), (_EQUAL, F_DUPFD_CLOEXEC, "lowest", "allow 2")]
    steps += ["lowest", (_LOAD, _low(2), "", ""), (_AT_LEAST, FIRST, "allow 2", "descriptor")]
    steps += ["epoll", (_LOAD, _low(1), "", ""), (_EQUAL, EPOLL_CTL_ADD, "", "allow 2")]
    steps += [(_LOAD, _low(2), "", ""), (_AT_LEAST, _NEGATIVE, "allow 2", "")]
    steps += [(_AT_LEAST, FIRST, "notify", "allow 2")]
    steps += ["duplicate", (_LOAD, _low(1), "", ""), (_AT_LEAST, FIRST, "allow 2", "notify")]
    steps += ["empty path", (_LOAD, _low(3), "", ""), (_ANY_BIT, AT_EMPTY_PATH, "", "notify")]
    steps += ["descriptor", (_LOAD, _low(0), "", "")]
    steps += [(_AT_LEAST, _NEGATIVE, "allow 2", "")]
    steps += [(_AT_LEAST, FIRST, "notify", "")]
    steps += ["allow 2", (_RETURN, _RET_ALLOW, "", "")]
    steps += ["notify", (_RETURN, _RET_NOTIFY, "", "")]
    return _assemble(steps)


def _jumps(names: Iterable[str], abi: Abi, label: str) -> list[Step | str]:
    return [(_EQUAL, abi.calls[name], label, "") for name in names if name in abi.calls]


def _low(argument: int) -> int:
    """Offset of the low half of an argument; all supported machines are little-endian."""
    return _ARGUMENT + 8 * argument


def _assemble(steps: Iterable[Step | str]) -> bytes:
    labels: dict[str, int] = {}
    plain: list[Step] = []
    for step in steps:
        if isinstance(step, str):
            labels[step] = len(plain)
        else:
            plain.append(step)
    program = b""
    for index, (code, operand, true, false) in enumerate(plain):
        jumps = [labels[label] - index - 1 if label else 0 for label in (true, false)]
        program += struct.pack("=HBBI", code, *jumps, operand)
    return program
