"""What passed between a host and a device, counted as it goes over the wire."""

from dataclasses import dataclass, fields
from typing import Self


@dataclass
class Exchanges:
    """Counts since a client was made.

    Attributes:
        sent: requests: frames on a serial line, transfers on I2C.
        answered: those that a whole frame followed, or that were acknowledged.
        late: those that were not, in time.
        repeated: those that asked for the same once more.
        refused: telecommands that the device answered with an error.
        streamed: frames of pictures, which come without a request each.
    """

    sent: int = 0
    answered: int = 0
    late: int = 0
    repeated: int = 0
    refused: int = 0
    streamed: int = 0

    def ended(self, answered: bool) -> None:
        """A request was answered, or its time is over."""
        self.answered += answered
        self.late += not answered

    def __add__(self, other: Self) -> "Exchanges":
        """Of two clients together."""
        names = [one.name for one in fields(self)]
        return Exchanges(*(getattr(self, name) + getattr(other, name) for name in names))
