"""Installs a seccomp filter and becomes the program; a script without imports of this package.

Arguments: descriptor of a socket, number of the seccomp call, the program and its arguments. The
script receives the filter on the socket, and sends back the listener's descriptor or the text of an
error. The socket closes when the program starts.
"""

import ctypes
import os
import signal
import socket
import sys

NO_NEW_PRIVS = 38
SET_MODE_FILTER = 1
NEW_LISTENER = 8
WAIT_KILLABLE = 32  # Linux 5.19: a signal does not restart the call, and so repeat a transfer
FILTER_BYTES = 4096
BYTES_PER_STEP = 8


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("steps", ctypes.c_char_p))


def install(libc: ctypes.CDLL, number: int, steps: bytes) -> int:
    """Install the filter on this process; returns the listener's descriptor, raises OSError."""
    if libc.prctl(NO_NEW_PRIVS, 1, 0, 0, 0):
        raise OSError(ctypes.get_errno(), "can not set no_new_privs")
    program = _Program(len(steps) // BYTES_PER_STEP, steps)
    for flags in (NEW_LISTENER | WAIT_KILLABLE, NEW_LISTENER):
        fd = int(libc.syscall(number, SET_MODE_FILTER, flags, ctypes.byref(program)))
        if fd >= 0:
            return fd
    code = ctypes.get_errno()
    raise OSError(code, f"the kernel refuses a seccomp listener ({os.strerror(code)})")


def main(link_fd: str, number: str, *command: str) -> None:
    link = socket.socket(fileno=int(link_fd))
    link.set_inheritable(False)
    libc = ctypes.CDLL(None, use_errno=True)
    steps = link.recv(FILTER_BYTES)
    for name in ("SIGPIPE", "SIGXFSZ"):  # Python sets these to be ignored
        signal.signal(getattr(signal, name), signal.SIG_DFL)
    try:
        listener = install(libc, int(number), steps)
        socket.send_fds(link, [b"+"], [listener])
        os.close(listener)
        os.execvp(command[0], command)
    except OSError as error:
        link.send(b"-" + str(error.strerror).encode())
    os._exit(127)


if __name__ == "__main__":
    main(*sys.argv[1:])
