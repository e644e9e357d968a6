"""What the host's device classes need of a client, whatever the bus.

Messages come from the interface tables; nothing about a device is written here.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from types import TracebackType
from typing import Self

from cubestack.firmware_model.interface.codec.message import Interface, Message, Value
from cubestack.host.errors import CommandRefusedError, NoAnswerError

__all__ = ["POLL_PERIOD_S", "Client", "DeviceClient", "Progress"]

#: Called with (pieces done, pieces in all) during a transfer.
Progress = Callable[[int, int], None]

#: Time between two polls of a node.
POLL_PERIOD_S = 0.01


class Client(ABC):
    """A node's telecommands and telemetry by name.

    Attributes:
        interface: the node's messages.
    """

    interface: Interface

    @abstractmethod
    def command(self, name: str, **parameters: object) -> None:
        """Send a telecommand and return once the node has accepted it.

        Raises InterfaceError for a name or value that the tables do not have, CommandRefusedError,
        NoAnswerError, TransportError.
        """

    @abstractmethod
    def telemetry(self, name: str) -> dict[str, Value]:
        """Fields of a telemetry frame by name, in the units of the tables.

        Raises InterfaceError, NoAnswerError, BadAnswerError, TransportError.
        """

    @abstractmethod
    def pause(self, seconds: float) -> None:
        """Let time pass on the node's side; what it sends meanwhile is lost."""

    @abstractmethod
    def close(self) -> None:
        """Release the bus."""

    def wait_processed(self, timeout_s: float) -> dict[str, Value]:
        """Poll telemetry TcmdProcessed until every accepted telecommand is processed.

        Returns that frame's fields. Raises NoAnswerError after ``timeout_s``.
        """
        for _ in range(math.ceil(timeout_s / POLL_PERIOD_S)):
            values = self.telemetry("TcmdProcessed")
            if values["Processed"]:
                return values
            self.pause(POLL_PERIOD_S)
        raise NoAnswerError(f"telecommand not processed within {timeout_s:g} s")

    def _check_error(self, message: Message, error: int) -> None:
        """Raise CommandRefusedError when an acknowledge's ``error`` code is one."""
        if error:
            known = {int(code): code for code in self.interface.ack_errors}
            raise CommandRefusedError(message.name, known.get(error, error))

    def __enter__(self) -> Self:
        """Use the client in a ``with`` block."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()


class DeviceClient:
    """A device as a program uses it, through any client of its node.

    Attributes:
        client: its messages by name.
    """

    def __init__(self, client: Client) -> None:
        """Use ``client``, whose interface must be the device's."""
        self.client = client
        self._on_close = client.close

    def close_with(self, callback: Callable[[], None]) -> None:
        """Let ``close`` release what ``callback`` does, in place of the client alone."""
        self._on_close = callback

    def close(self) -> None:
        """Release the port."""
        self._on_close()

    def __enter__(self) -> Self:
        """Use the device in a ``with`` block."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()
