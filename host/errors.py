"""Errors between a host program and a node; every text is one line.

Values that a message cannot carry raise ``InterfaceError`` of the interface tables (a ValueError)
before anything is sent.
"""

import re
import shlex
from enum import IntEnum
from importlib.metadata import requires


class TargetError(ValueError):
    """The text does not name a target."""


class CameraFileError(ValueError):
    """A camera file is missing, unreadable or incomplete."""


class HostError(OSError):
    """Base of all errors while talking to a node."""


class TransportError(HostError):
    """The connection failed."""


class PortOpenError(TransportError):
    """The port does not open."""


class PortClosedError(TransportError):
    """The other side closed the connection."""


class RecordingMismatchError(TransportError):
    """The recording has another request at this position."""


class NodeError(HostError):
    """The node did not perform the request."""


class NoAnswerError(NodeError, TimeoutError):
    """No complete answer came in time."""


class BadAnswerError(NodeError):
    """The answer violates the interface."""


class NotSupportedError(NodeError):
    """The node does not have this message of the tables."""


class StepFailedError(NodeError):
    """The node tried and failed."""


class CommandRefusedError(NodeError):
    """The node rejected a telecommand.

    Attributes:
        code: error code of the acknowledge; a plain int if the interface does not define it.
    """

    def __init__(self, command: str, code: IntEnum | int, reason: str = "") -> None:
        name = code.name if isinstance(code, IntEnum) else "unknown code"
        super().__init__(f"telecommand {command} refused: {name} ({int(code)}){reason}")
        self.code = code


def install_command(extra: str) -> str:
    """The command that installs the packages of an extra, wherever cubestack was installed from."""
    marker = re.compile(rf"\bextra == [\"']{extra}[\"']")
    lines = [one.partition(";") for one in requires("cubestack") or ()]
    return (
        f"pip install {shlex.join(name.strip() for name, _, when in lines if marker.search(when))}"
    )
