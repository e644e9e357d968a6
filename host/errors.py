"""What can go wrong between a host program and a node; every text is one line.

Values that a message can not carry raise ``InterfaceError`` of the interface tables (a ValueError)
before anything is sent.
"""

from enum import IntEnum


class TargetError(ValueError):
    """The text that names a target makes no sense."""


class CameraFileError(ValueError):
    """A camera file is missing, unreadable, or lacks something."""


class HostError(OSError):
    """Base of everything that fails while talking to a node."""


class TransportError(HostError):
    """The connection failed."""


class PortOpenError(TransportError):
    """The port does not open."""


class PortClosedError(TransportError):
    """The other side has gone."""


class RecordingMismatchError(TransportError):
    """A recording has no such request at this place."""


class NodeError(HostError):
    """The node did not do what was asked."""


class NoAnswerError(NodeError, TimeoutError):
    """Nothing, or nothing whole, came back in time."""


class BadAnswerError(NodeError):
    """An answer came that the interface does not allow."""


class NotSupportedError(NodeError):
    """The tables have a message that the node does not."""


class StepFailedError(NodeError):
    """The node tried and failed."""


class CommandRefusedError(NodeError):
    """A telecommand was refused.

    Attributes:
        code: the acknowledge's error code; a plain int when the interface does not know it.
    """

    def __init__(self, command: str, code: IntEnum | int, reason: str = "") -> None:
        name = code.name if isinstance(code, IntEnum) else "unknown code"
        super().__init__(f"telecommand {command} refused: {name} ({int(code)}){reason}")
        self.code = code
