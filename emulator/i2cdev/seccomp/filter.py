"""The seccomp filter that sends a program's calls to its supervisor, as classic BPF.

It sends only calls that may concern the device file: those with a path, the ioctl requests of
Linux's I2C devices, and calls on descriptors in the supervisor's range. All others run at full
speed.
"""

import platform
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from cubestack.firmware_model.formats.linux_i2c import Ioctl

AT_EMPTY_PATH = 0x1000
F_DUPFD = 0
F_DUPFD_CLOEXEC = 1030

ON_PATH = (
    *("open", "openat", "openat2", "stat", "lstat", "newfstatat", "statx"),
    *("access", "faccessat", "faccessat2", "readlink", "readlinkat"),
    *("getxattr", "lgetxattr"),
)
ON_DESCRIPTOR = ("read", "write", "readv", "writev", "fstat", "dup")


@dataclass(frozen=True)
class Abi:
    """System call interface of a processor architecture."""

    audit_arch: int  # AUDIT_ARCH_* of linux/audit.h
    calls: Mapping[str, int]  # system call numbers by name
    seccomp: int  # number of the call that installs a filter
    compact_stat: bool  # whether struct stat is that of asm-generic/stat.h


def _calls(table: str) -> dict[str, int]:
    words = table.split()
    return {name: int(number) for name, number in zip(words[::2], words[1::2], strict=True)}


_X86_64 = _calls("""
    read 0 write 1 open 2 stat 4 fstat 5 lstat 6 ioctl 16 readv 19 writev 20 access 21 dup 32
    fcntl 72 readlink 89 getxattr 191 lgetxattr 192 openat 257 newfstatat 262 readlinkat 267
    faccessat 269 statx 332 openat2 437 faccessat2 439
""")
_GENERIC = _calls("""
    getxattr 8 lgetxattr 9 dup 23 fcntl 25 ioctl 29 faccessat 48 openat 56 read 63 write 64 readv 65
    writev 66 readlinkat 78 newfstatat 79 fstat 80 statx 291 openat2 437 faccessat2 439
""")

#: By the kernel's name of the machine.
ABIS = {
    "x86_64": Abi(0xC000_003E, _X86_64, 317, compact_stat=False),
    "aarch64": Abi(0xC000_00B7, _GENERIC, 277, compact_stat=True),
    "riscv64": Abi(0xC000_00F3, _GENERIC, 277, compact_stat=True),
}

_RET_ALLOW = 0x7FFF_0000
_RET_NOTIFY = 0x7FC0_0000
_X32_BIT = 0x4000_0000

_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_NUMBER, _ARCH, _ARGUMENT = 0, 4, 16

Step = tuple[int, int, str, str]  # code, operand, label if true, label if false; "": next step


def native_abi() -> Abi | None:
    """The ABI of this machine; None if it is not supported."""
    return ABIS.get(platform.machine())


def make_filter(abi: Abi, descriptors: range) -> bytes:
    """The filter program, as an array of struct sock_filter."""
    steps: list[Step | str] = [
        (_LOAD, _ARCH, "", ""),
        (_EQUAL, abi.audit_arch, "", "allow"),
        (_LOAD, _NUMBER, "", ""),
        (_AT_LEAST, _X32_BIT, "allow", ""),
    ]
    calls = abi.calls
    steps += [(_EQUAL, calls["ioctl"], "ioctl", "")]
    steps += _jumps(ON_DESCRIPTOR, abi, "descriptor")
    steps += [
        (_EQUAL, calls["fcntl"], "fcntl", ""),
        (_EQUAL, calls["newfstatat"], "empty path", ""),
    ]
    steps += _jumps(ON_PATH, abi, "notify")
    steps += ["allow", (_RETURN, _RET_ALLOW, "", "")]
    steps += ["ioctl", (_LOAD, _low(1), "", "")]
    steps += [(_EQUAL, number, "notify", "") for number in Ioctl]
    steps += [(_RETURN, _RET_ALLOW, "", "")]
    steps += ["fcntl", (_LOAD, _low(1), "", "")]
    steps += [(_EQUAL, F_DUPFD, "descriptor", ""), (_EQUAL, F_DUPFD_CLOEXEC, "descriptor", "")]
    steps += [(_RETURN, _RET_ALLOW, "", "")]
    steps += ["empty path", (_LOAD, _low(3), "", ""), (_ANY_BIT, AT_EMPTY_PATH, "", "notify")]
    steps += ["descriptor", (_LOAD, _low(0), "", "")]
    steps += [(_AT_LEAST, descriptors.stop, "allow 2", "")]
    steps += [(_AT_LEAST, descriptors.start, "notify", "")]
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
