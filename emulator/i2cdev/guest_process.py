"""Starts a program that sees the emulated /dev/i2c-N, by one of two routes.

seccomp  The kernel sends the program's calls to a supervisor in this process. Works with any
         program, including static ones, and without a compiler. Needs Linux 5.9, and permission
         to install a filter. With a compiler, a small library in dynamic programs repeats the calls
         that a signal ended too early.
preload  A library in the program intercepts the calls. Works with programs that are linked
         dynamically with glibc. Needs a C compiler, once; works in containers that forbid seccomp.
"""

import contextlib
import ctypes
import errno
import os
import select
import shutil
import socket
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from cubestack.emulator.i2cdev.device_node import DeviceNode
from cubestack.emulator.i2cdev.preload.shim import is_static
from cubestack.emulator.i2cdev.seccomp.abi import native_abi
from cubestack.emulator.i2cdev.seccomp.filter import make_filter
from cubestack.emulator.i2cdev.seccomp.notify import Listener, read_memory
from cubestack.emulator.i2cdev.seccomp.supervisor import Files, Supervisor
from cubestack.emulator.ports.endpoint import Endpoint, poll_now

Route = Literal["seccomp", "preload"]

LAUNCHER = Path(__file__).parent / "seccomp" / "launcher.py"
MESSAGE_BYTES = 4096
PR_SET_CHILD_SUBREAPER = 36
SEPARATORS = frozenset(": \t\n")
"""Separators between libraries in LD_PRELOAD."""

SIGNALLED = 128
"""Exit status of a program that a signal ended, minus the signal's number, as in shells."""


Streams = tuple[int | None, int | None]
"""Descriptors for a program's standard output and standard error; None: those of this process."""

INHERITED: Streams = (None, None)


class RouteError(RuntimeError):
    """A route is not available on this machine; the text has the reason."""


def bus_environment(bus: int, path: str) -> dict[str, str]:
    """Environment variables for a program: number of the bus, and path of its socket."""
    return {"CUBESTACK_I2C_BUS": str(bus), "CUBESTACK_I2C_SOCKET": path}


def preload_environment(library: Path) -> dict[str, str]:
    """Environment variables that load ``library`` before those of the user; raises RouteError."""
    if SEPARATORS & set(str(library)):
        raise RouteError(f"{library} has a blank or colon; set XDG_CACHE_HOME to another folder")
    libraries = (str(library), os.environ.get("LD_PRELOAD", ""))
    # AddressSanitizer otherwise refuses any library that is loaded before its own
    options = (os.environ.get("ASAN_OPTIONS", ""), "verify_asan_link_order=0")
    return {
        "LD_PRELOAD": " ".join(filter(None, libraries)),
        "ASAN_OPTIONS": ":".join(filter(None, options)),
    }


class GuestProcess(Endpoint):
    """A running program; as a port of a scheduler, it reports the program's end."""

    def __init__(
        self, process: "subprocess.Popen[bytes]", name: str, *, reaps_children: bool = False
    ) -> None:
        self.name = name
        self._reaps_children = reaps_children
        self._process = process
        self._pidfd = os.pidfd_open(process.pid)

    @property
    def ended(self) -> bool:
        return self._process.returncode is not None

    @property
    def exit_code(self) -> int:
        """Exit status as in a shell; waits for the end."""
        code = self._process.wait()
        return code if code >= 0 else SIGNALLED - code

    def send(self, number: int) -> None:
        self._process.send_signal(number)

    def watched(self) -> list[tuple[int, int]]:
        return [] if self.ended else [(self._pidfd, select.POLLIN)]

    def exchange(self, now_ps: int) -> None:
        if not self.ended:
            if poll_now(self._pidfd, select.POLLIN):
                self._process.poll()
        elif self._reaps_children:
            _reap_children()

    def close(self) -> None:
        """Stop watching; the program continues."""
        os.close(self._pidfd)


def start_plain(command: Sequence[str]) -> GuestProcess:
    """Start ``command``, which needs no route; raises OSError."""
    return GuestProcess(subprocess.Popen(command, close_fds=False), command[0])


def start_filtered(
    command: Sequence[str],
    environment: dict[str, str],
    node: DeviceNode,
    files: Files,
    streams: Streams = INHERITED,
) -> tuple[GuestProcess, Supervisor]:
    """Start ``command`` under a supervisor, which the caller must serve from now on.

    Raises RouteError if the kernel or the container does not allow it.
    """
    abi = native_abi()
    if abi is None:
        raise RouteError(f"system calls of {os.uname().machine} are not supported")
    # With yama, a process may read only the memory of its descendants.
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        theirs.set_inheritable(True)
        launch = [sys.executable, "-I", "-S", str(LAUNCHER), str(theirs.fileno())]
        process = subprocess.Popen(
            [*launch, str(abi.seccomp), *command],
            env=os.environ | environment,
            close_fds=False,  # the program inherits our descriptors
            stdout=streams[0],
            stderr=streams[1],
        )
        theirs.close()
        _check_access(process)
        ours.send(make_filter(abi))
        answer, descriptors, _, _ = socket.recv_fds(ours, MESSAGE_BYTES, 1)
    if not descriptors:
        process.wait()
        raise RouteError(answer[1:].decode() or "the launcher failed")
    supervisor = Supervisor(Listener(descriptors[0]), abi, node, files)
    return GuestProcess(process, command[0], reaps_children=True), supervisor


def start_preloaded(
    command: Sequence[str], environment: dict[str, str], library: Path, streams: Streams = INHERITED
) -> GuestProcess:
    """Start ``command`` with the shim ``library``; the caller must serve the socket it uses.

    Raises RouteError if no library can be loaded into it.
    """
    program = shutil.which(command[0])
    if program is not None and is_static(Path(program)):
        raise RouteError(f"{program} is linked statically, so no library can be loaded into it")
    process = subprocess.Popen(
        command,
        env=os.environ | environment | preload_environment(library),
        close_fds=False,
        stdout=streams[0],
        stderr=streams[1],
    )
    return GuestProcess(process, command[0])


def _check_access(process: "subprocess.Popen[bytes]") -> None:
    """Raise RouteError, and end ``process``, unless its memory is readable."""
    try:
        read_memory(process.pid, 0, 1)
    except OSError as error:
        if error.errno != errno.EFAULT:  # EFAULT: access is permitted, but the page is unmapped
            process.kill()
            process.wait()
            raise RouteError(f"no access to the program's memory ({error.strerror})") from None


def _reap_children() -> None:
    """Reap ended processes, which makes the kernel release their filter."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
