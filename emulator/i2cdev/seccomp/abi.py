"""System call numbers of the supported machines (linux: asm/unistd_64.h, asm-generic/unistd.h)."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass


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


_NEWER = """
    io_uring_setup 425 openat2 437 faccessat2 439
"""
"""The same on all machines."""

_X86_64 = _calls(f"""
    read 0 write 1 open 2 stat 4 fstat 5 lstat 6 ioctl 16 pread64 17 pwrite64 18 readv 19 writev 20
    access 21 dup 32 dup2 33 sendfile 40 fcntl 72 creat 85 readlink 89 getxattr 191 lgetxattr 192
    getdents64 217 epoll_ctl 233 openat 257 newfstatat 262 readlinkat 267 faccessat 269 splice 275
    dup3 292 preadv 295 pwritev 296 copy_file_range 326 preadv2 327 pwritev2 328 statx 332 {_NEWER}
""")
_GENERIC = _calls(f"""
    getxattr 8 lgetxattr 9 epoll_ctl 21 dup 23 dup3 24 fcntl 25 ioctl 29 faccessat 48 openat 56
    getdents64 61 read 63 write 64 readv 65 writev 66 pread64 67 pwrite64 68 preadv 69 pwritev 70
    sendfile 71 splice 76 readlinkat 78 newfstatat 79 fstat 80 copy_file_range 285 preadv2 286
    pwritev2 287 statx 291 {_NEWER}
""")

#: By the kernel's name of the machine.
ABIS = {
    "x86_64": Abi(0xC000_003E, _X86_64, 317, compact_stat=False),
    "aarch64": Abi(0xC000_00B7, _GENERIC, 277, compact_stat=True),
    "riscv64": Abi(0xC000_00F3, _GENERIC, 277, compact_stat=True),
}


def native_abi() -> Abi | None:
    """The ABI of this machine; None if it is not supported."""
    return ABIS.get(platform.machine())
