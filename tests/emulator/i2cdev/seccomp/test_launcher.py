import ctypes
import errno
import os
import socket
from typing import Any

import pytest

from cubestack.emulator.i2cdev.seccomp import launcher

STEPS = bytes(range(1, 25))
CALL = 317


class Libc:
    """Records calls; ``fails`` names those that fail, ``flags`` are the supported flags."""

    def __init__(self, fails: str = "", flags: tuple[int, ...] = (8 | 32, 8)) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.fails, self.flags = fails, flags

    def prctl(self, *arguments: int) -> int:
        self.calls.append(arguments)
        ctypes.set_errno(errno.EACCES)
        return -1 if self.fails == "prctl" else 0

    def syscall(self, number: int, mode: int, flags: int, program: Any) -> int:
        made = program._obj
        self.calls.append((number, mode, flags, made.steps[: 8 * made.length]))
        ctypes.set_errno(errno.EBUSY)
        return 7 if flags in self.flags else -1


def install(libc: Libc) -> int:
    return launcher.install(libc, CALL, STEPS)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("flags", "tried"), [((40, 8), [40]), ((8,), [40, 8])], ids=["linux-5.19", "before"]
)
def test_kernel_returns_a_listener(flags: tuple[int, ...], tried: list[int]) -> None:
    """PR_SET_NO_NEW_PRIVS is 38, SECCOMP_SET_MODE_FILTER 1; flags as in linux/seccomp.h."""
    libc = Libc(flags=flags)
    assert install(libc) == 7
    assert libc.calls == [(38, 1, 0, 0, 0), *((CALL, 1, flag, STEPS) for flag in tried)]


def test_reports_kernel_errors() -> None:
    with pytest.raises(OSError, match="can not set no_new_privs") as caught:
        install(Libc("prctl"))
    assert caught.value.errno == errno.EACCES
    with pytest.raises(OSError, match=r"the kernel refuses a seccomp listener \(.*busy") as caught:
        install(Libc(flags=()))
    assert caught.value.errno == errno.EBUSY
    zero = Libc()
    zero.syscall = lambda *_arguments: 0  # type: ignore[method-assign]
    assert install(zero) == 0


def test_program_starts_after_listener_handover(monkeypatch: pytest.MonkeyPatch) -> None:
    """The filter comes over the socket; what goes back leads to the same pipe."""
    link, theirs = socket.socketpair()
    reader, listener = os.pipe()
    libc, started = Libc(), []
    libc.syscall = lambda *_arguments: listener  # type: ignore[method-assign]
    monkeypatch.setattr(launcher.socket, "socket", lambda fileno: theirs)
    monkeypatch.setattr(launcher.ctypes, "CDLL", lambda *_arguments, **_options: libc)
    monkeypatch.setattr(launcher.signal, "signal", lambda *_arguments: None)
    monkeypatch.setattr(launcher.os, "execvp", lambda *command: started.append(command))
    monkeypatch.setattr(launcher.os, "_exit", lambda _code: None)
    with link, theirs, open(reader, "rb") as pipe:
        link.send(STEPS)
        launcher.main(str(theirs.fileno()), str(CALL), "program", "argument")
        link.setblocking(False)
        text, given, *_ = socket.recv_fds(link, 10, 1)
        with open(given[0], "wb") as end:
            end.write(b"x")
        assert (text, pipe.read(), started) == (b"+", b"x", [("program", ("program", "argument"))])
