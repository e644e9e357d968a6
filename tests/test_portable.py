"""Linux-only features are used at run time, not at import, as macOS needs."""

import subprocess
import sys

import pytest

#: Imports all modules of the library in a process that looks like macOS.
ON_MACOS = """
import ctypes, fcntl, importlib, os, pkgutil, resource, select, signal, socket, sys, time

names = ["cubestack"]
for folder in ("hdl", "firmware_model", "emulator", "host"):
    top = importlib.import_module(f"cubestack.{folder}")
    found = pkgutil.walk_packages(top.__path__, f"{top.__name__}.")
    names += [top.__name__, *(one.name for one in found if not one.name.endswith("__main__"))]
names = [name for name in names if ".basilisk" not in name]  # which a package of others must bring
for name in names:
    importlib.import_module(name)  # and with it what others wrote, which is not what is tested
for name in [name for name in sys.modules if name.partition(".")[0] == "cubestack"]:
    del sys.modules[name]

LACKING = {
    select: "epoll EPOLLIN EPOLLOUT POLLRDHUP",
    os: "sched_getaffinity sched_setaffinity sched_getscheduler sched_setscheduler pidfd_open "
    "memfd_create eventfd pipe2 splice copy_file_range posix_fadvise O_PATH O_TMPFILE getrandom",
    signal: "pidfd_send_signal sigtimedwait sigwaitinfo SIGPWR SIGPOLL SIGRTMIN SIGRTMAX",
    socket: "AF_NETLINK AF_PACKET SOCK_CLOEXEC SOCK_NONBLOCK SO_PEERCRED",
    time: "CLOCK_BOOTTIME",
    resource: "prlimit",
    fcntl: "F_SETPIPE_SZ F_ADD_SEALS",
}
for module, lacking in LACKING.items():
    for name in lacking.split():
        if hasattr(module, name):
            delattr(module, name)


class Library(ctypes.CDLL):
    def __getattr__(self, name):
        if name in ("ppoll", "prctl", "epoll_create1", "pidfd_open"):
            raise AttributeError(name)
        return super().__getattr__(name)


ctypes.CDLL = Library
sys.platform = "darwin"
for name in names:
    importlib.import_module(name)
print(len(names), "modules")
if len(sys.argv) > 1:
    sys.exit(importlib.import_module("cubestack.host.cli.main").main(sys.argv[1:]))
"""


def on_macos(*words: str) -> "subprocess.CompletedProcess[str]":
    call = [sys.executable, "-c", ON_MACOS, *words]
    return subprocess.run(call, capture_output=True, text=True, timeout=300)


@pytest.mark.slow
def test_modules_import_and_a_device_runs_on_macos() -> None:
    done = on_macos("shell", "emulated:cubesense", "-c", "read Power")
    assert done.returncode == 0, done.stderr
    first, *said = done.stdout.splitlines()
    assert int(first.split()[0]) > 500
    assert any(line.startswith("Current3V3") for line in said)


@pytest.mark.slow
@pytest.mark.parametrize("words", [("run", "--", "true"), ("emulate", "cubestar", "--i2c", "7")])
def test_linux_only_commands_print_one_line(words: tuple[str, ...]) -> None:
    done = on_macos(*words)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.endswith("an I2C bus for unmodified programs needs Linux")
