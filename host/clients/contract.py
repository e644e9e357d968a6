"""What a client of a node is, whatever the bus, and what the clients of all devices share."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, Self, TypeVar

from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.firmware_model.interface.codec.node_codes import AckError
from cubestack.firmware_model.interface.codec.switch_messages import (
    SET_PROFILE,
    SET_SWITCH,
    SHOWN,
    read_switches,
    switch_parameters,
)
from cubestack.firmware_model.interface.codec.switches import Switches
from cubestack.host.clients.exchanges import Exchanges
from cubestack.host.errors import (
    BadAnswerError,
    CommandRefusedError,
    NoAnswerError,
    NotSupportedError,
    TargetError,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

#: Called with (pieces done, pieces in all) during a transfer.
Progress = Callable[[int, int], None]

#: A line of a log by the names of its columns; None where there is no value.
Columns = dict[str, bool | int | float | str | None]

T = TypeVar("T")

#: Time between two polls of a node: its tasks take tenths of a second.
POLL_PERIOD_S = 0.04


class Closable(ABC):
    """What is closed at the end of a ``with`` block."""

    @abstractmethod
    def close(self) -> None:
        """Release the port or bus."""

    def __enter__(self) -> Self:
        """Use it in a ``with`` block."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close."""
        self.close()


class Client(Closable):
    """A node's telecommands and telemetry by name.

    Attributes:
        interface: the node's messages.
    """

    interface: Interface

    @cached_property
    def exchanges(self) -> Exchanges:
        """What went over the wire by now."""
        return Exchanges()

    @abstractmethod
    def command(self, name: str, **parameters: object) -> None:
        """Send a telecommand and return once the node has accepted it.

        Raises InterfaceError for a name or value that the tables do not have, CommandRefusedError,
        NoAnswerError, TransportError.
        """

    @abstractmethod
    def telemetry(self, name: str) -> dict[str, Value]:
        """Fields of a telemetry frame by name, in the units of the tables.

        Raises InterfaceError, NotSupportedError, NoAnswerError, BadAnswerError, TransportError.
        """

    @abstractmethod
    def pause(self, seconds: float) -> None:
        """Let time pass on the node's side; what it sends meanwhile is lost."""

    def _asked(self, name: str) -> Message:
        """The telemetry ``name`` means; NotSupportedError where no node answers with it."""
        message = self.interface.telemetry(name)
        if not message.supported:
            raise NotSupportedError(f"telemetry {message.name} is not supported by the node")
        return message

    def stream(self, name: str, count: int) -> Iterator[bytes]:
        """Send telecommand ``name``, then yield the payloads of ``count`` frames without requests.

        Raises NoAnswerError when the stream ends early, and TypeError on a bus where the host asks
        for every byte.
        """
        raise TypeError(f"{name}: a picture can be streamed over a UART only")

    def wait_processed(self, timeout_s: float) -> dict[str, Value]:
        """Poll telemetry TcmdProcessed until every accepted telecommand is processed.

        Returns that frame's fields. Raises NoAnswerError after ``timeout_s``.
        """
        return self.poll(
            lambda: self.telemetry("TcmdProcessed"),
            lambda values: bool(values["Processed"]),
            timeout_s,
            f"telecommand not processed within {timeout_s:g} s",
        )

    def poll(
        self,
        read: Callable[[], T],
        done: Callable[[T], bool],
        timeout_s: float,
        late: str,
        period_s: float = POLL_PERIOD_S,
    ) -> T:
        """``read`` until it gives what is ``done``; NoAnswerError ``late`` after ``timeout_s``."""
        for number in range(math.ceil(timeout_s / period_s)):
            found = read()
            if done(found):
                return found
            self.pause(min(period_s, timeout_s - number * period_s))
        raise NoAnswerError(late)

    def _check_error(self, message: Message, error: int) -> None:
        """Raise CommandRefusedError when an acknowledge's ``error`` code is one."""
        if error:
            self.exchanges.refused += 1
            known = {int(code): code for code in self.interface.ack_errors}
            raise CommandRefusedError(message.name, known.get(error, error))


class FoundStar(Protocol):
    """A centroid in a picture, and the star's Hipparcos number when it is identified."""

    @property
    def x_px(self) -> float:
        """Column."""

    @property
    def y_px(self) -> float:
        """Row."""

    @property
    def hipparcos(self) -> int | None:
        """None when it is not identified."""


class DeviceClient(Closable):
    """A device as a program uses it, through any client of its node.

    Attributes:
        client: its messages by name.
    """

    picture_sources: tuple[str, ...] = ()
    """Memories that ``picture`` can read, in small letters; none where there is one only."""

    step_timeout_s = 10.0
    """What a step of the node may take."""

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

    def picture(
        self, source: str | None = None, progress: Progress | None = None
    ) -> "NDArray[np.uint8]":
        """The picture (rows, columns) in the device's memory, or in the memory ``source``.

        ``progress`` is told after each block how many of how many there are; what it raises ends
        the download. Raises TargetError for a device or a line that carries no picture, and the
        client's errors.
        """
        raise TargetError(f"{self.client.interface.name} sends no picture")

    def upload(self, picture: "NDArray[np.uint8]", progress: Progress | None = None) -> None:
        """Put grey values (rows, columns) into the device's memory in place of its own picture.

        Raises TargetError for a device that takes none, ValueError for another shape, and the
        client's errors.
        """
        raise TargetError(f"{self.client.interface.name} takes no picture by the wire")

    def stars(self) -> Sequence[FoundStar]:
        """The stars of the latest picture.

        Raises TargetError for a device that looks for none, and the client's errors.
        """
        raise TargetError(f"{self.client.interface.name} looks for no stars")

    def profile(self) -> Switches:
        """The switches that the device runs with; their ``profile`` says of which one they are.

        Raises InterfaceError for a device without switches, and the client's errors.
        """
        return read_switches(self.client.interface.switches, self.client.telemetry(SHOWN))

    def set_profile(self, profile: str) -> None:
        """Run "published" or "extended" from the next picture on; the board's switches stay.

        Raises as ``Client.command`` does.
        """
        self.perform(SET_PROFILE, Profile=profile)

    def set_switch(self, switch: str, value: str) -> None:
        """Set one switch, as `cubestack registers DEVICE --switches` lists them; see above."""
        self.perform(SET_SWITCH, **switch_parameters(switch, value))

    def take_picture(self) -> None:
        """Take a picture of the sky, whatever the device makes of it.

        Raises TargetError for a device that is no star tracker, and the client's errors.
        """
        raise TargetError(f"{self.client.interface.name} takes no picture of the sky")

    def latest(self) -> Columns:
        """The latest result, for a log; angles that are not valid are None.

        Columns of angles end in "_deg"; "image_time_s" is the picture's time by the node's clock,
        where it tells that. Raises TargetError for a device without, and the client's errors.
        """
        raise TargetError(f"{self.client.interface.name} has no results that could be logged")

    def perform(self, name: str, **parameters: object) -> None:
        """Send a telecommand and wait until it is done."""
        self._send(name, **parameters)
        self.client.wait_processed(self.step_timeout_s)

    def _send(self, name: str, **parameters: object) -> None:
        """Send a telecommand; when the node's buffer is full, wait and send it once more."""
        try:
            self.client.command(name, **parameters)
        except CommandRefusedError as refusal:
            if refusal.code != AckError.BUFFER_FULL:
                raise
            self.client.wait_processed(self.step_timeout_s)
            self.client.command(name, **parameters)

    def _stream(self, name: str, count: int, length: int, progress: Progress | None) -> bytes:
        """What telecommand ``name`` streams: ``count`` blocks of ``length`` bytes."""
        blocks = []
        for block in self.client.stream(name, count):
            if len(block) != length:
                raise BadAnswerError(f"picture stream: block of {len(block)} bytes, not {length}")
            blocks.append(block)
            if progress is not None:
                progress(len(blocks), count)
        return b"".join(blocks)

    def _records(self, frame: str, count: int) -> dict[int, dict[str, Value]]:
        """All ``count`` records of a telemetry frame that steps, in the order of star numbers."""
        records: dict[int, dict[str, Value]] = {}
        reads = 2 * count  # one round, and another for records whose answer was lost
        for _ in range(reads):
            if len(records) == count:
                break
            values = self.client.telemetry(frame)
            records[int(values["StarNumber"])] = values
        if len(records) != count:
            raise BadAnswerError(
                f"telemetry {frame}: {len(records)} stars of {count} came in {reads} reads"
            )
        return dict(sorted(records.items()))
