"""Emulations that a page starts for itself: each a process of `cubestack emulate`."""

import os
import re
import subprocess
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Thread

from cubestack.host.devices.remote_controls import TOKEN, ControlClient, RemoteControls
from cubestack.host.devices.targets import Target, open_target
from cubestack.host.errors import PortOpenError
from cubestack.host.ground.guard import new_token

_CONTROL = re.compile(r"control on (\S+), token ")
_SERVES = re.compile(r" serves on (tcp://\S+) ")

ENDING_S = 10.0
"""Wall time that a process has to end when it is asked to."""


@contextmanager
def emulated(device: str, options: Sequence[str] = ()) -> Iterator[Target]:
    """The device ``device``, emulated in a process of its own as long as the block lasts.

    Args:
        device: its name.
        options: of `cubestack emulate`.

    Raises PortOpenError with what it said when it does not start.
    """
    token = new_token()
    call = [sys.executable, "-m", "cubestack", "emulate", device, *options]
    process = subprocess.Popen(
        [*call, "--tcp", "0", "--control", "0"],
        stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, TOKEN: token},
    )
    try:
        control, port = _addresses(process)
        # What it says later, for instance that it is behind, must not fill the pipe.
        Thread(target=lambda: deque(process.stderr or (), maxlen=0), daemon=True).start()
        target = open_target(port, device)
        target.name = f"emulated:{device}"
        target.controls = RemoteControls(ControlClient(control, token), device)
        yield target
    finally:
        process.terminate()
        try:
            process.wait(ENDING_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _addresses(process: "subprocess.Popen[str]") -> tuple[str, str]:
    """Of its control port and its first serial line."""
    assert process.stderr is not None
    control, said = None, list[str]()
    for line in process.stderr:
        said.append(line.strip())
        if found := _CONTROL.search(line):
            control = found[1]
        elif control is not None and (found := _SERVES.search(line.replace(",", " "))):
            return control, found[1]
    raise PortOpenError("; ".join(said) or f"the emulation ended with {process.wait()}")
