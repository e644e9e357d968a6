"""Counters of the traffic between a host and a device."""

from dataclasses import dataclass, fields
from typing import Self


@dataclass
class Exchanges:
    """Counts since a client was made."""

    sent: int = 0  #: requests: frames on a serial line, transfers on I2C
    answered: int = 0  #: requests with a whole answer or an acknowledge
    late: int = 0  #: requests that timed out
    repeated: int = 0  #: retries
    refused: int = 0  #: telecommands answered with an error
    streamed: int = 0  #: image frames, which come without requests

    def ended(self, answered: bool) -> None:
        """Count a request as answered or timed out."""
        self.answered += answered
        self.late += not answered

    def __add__(self, other: Self) -> "Exchanges":
        """Of two clients together."""
        names = [one.name for one in fields(self)]
        return Exchanges(*(getattr(self, name) + getattr(other, name) for name in names))
