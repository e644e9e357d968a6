"""Emulations that a page starts for itself: each a process of `cubestack emulate`."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from cubestack.host.devices.emulating import emulating
from cubestack.host.devices.remote_controls import TOKEN, ControlClient, RemoteControls
from cubestack.host.devices.targets import Target, open_target
from cubestack.host.errors import PortOpenError
from cubestack.host.ground.guard import new_token

_CONTROL = re.compile(r"control on (\S+), token ")
_SERVES = re.compile(r" serves on (tcp://\S+) ")


@contextmanager
def emulated(device: str, options: Sequence[str] = ()) -> Iterator[Target]:
    """The device ``device``, emulated in a process of its own as long as the block lasts.

    Args:
        device: its name.
        options: of `cubestack emulate`.

    Raises PortOpenError with what it said when it does not start.
    """
    token = new_token()
    words = [device, *options, "--tcp", "0", "--control", "0"]
    with emulating(words, {TOKEN: token}) as said:
        control, port = _addresses(said)
        target = open_target(port, device)
        target.name = f"emulated:{device}"
        target.controls = RemoteControls(ControlClient(control, token), device)
        yield target


def _addresses(said: Iterator[str]) -> tuple[str, str]:
    """Of its control port and its first serial line."""
    control, lines = None, list[str]()
    for line in said:
        lines.append(line)
        if found := _CONTROL.search(line):
            control = found[1]
        elif control is not None and (found := _SERVES.search(line.replace(",", " "))):
            return control, found[1]
    raise PortOpenError("; ".join(lines) or "the emulation did not start")
