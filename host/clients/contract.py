"""The client of a node on any bus, and what all devices' clients share."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, Self, TypeVar

from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.firmware_model.interface.codec.switch_messages import (
    SET_PROFILE,
    SET_SWITCH,
    SHOWN,
    read_switches,
    switch_parameters,
)
from cubestack.firmware_model.interface.codec.switches import Switches
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
        names = [one.name for one in fields(self)]
        return Exchanges(*(getattr(self, name) + getattr(other, name) for name in names))


#: Called with (blocks done, total) during a transfer.
Progress = Callable[[int, int], None]

#: A line of a log by column; None for no value.
Columns = dict[str, bool | int | float | str | None]

T = TypeVar("T")

#: Time between polls of a node in s: its tasks take tenths of a second.
POLL_PERIOD_S = 0.04


class Closable(ABC):
    """Closed at the end of a ``with`` block."""

    @abstractmethod
    def close(self) -> None:
        """Release the port or bus."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()


class Client(Closable):
    """A node's telecommands and telemetry by name."""

    interface: Interface  #: the node's messages

    @cached_property
    def exchanges(self) -> Exchanges:
        """Counts of exchanges so far."""
        return Exchanges()

    @abstractmethod
    def command(self, name: str, **parameters: object) -> None:
        """Send a telecommand; returns when the node has accepted it.

        Raises InterfaceError for an invalid name or value, CommandRefusedError, NoAnswerError,
        TransportError.
        """

    @abstractmethod
    def telemetry(self, name: str) -> dict[str, Value]:
        """Fields of a telemetry frame by name, in the units of the tables.

        Raises InterfaceError, NotSupportedError, NoAnswerError, BadAnswerError, TransportError.
        """

    @abstractmethod
    def pause(self, seconds: float) -> None:
        """Let time pass on the node's side; bytes that it sends meanwhile are lost."""

    def _asked(self, name: str) -> Message:
        """The telemetry called ``name``; raises NotSupportedError if no node has it."""
        message = self.interface.telemetry(name)
        if not message.supported:
            raise NotSupportedError(f"telemetry {message.name} is not supported by the node")
        return message

    def stream(self, name: str, count: int) -> Iterator[bytes]:
        """Send telecommand ``name``, then yield the payloads of ``count`` frames without requests.

        Raises NoAnswerError if the stream ends early, TypeError on I2C, where a node cannot stream.
        """
        raise TypeError(f"{name}: an image can be streamed over a UART only")

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
        """Repeat ``read`` until ``done``; raises NoAnswerError ``late`` after ``timeout_s``."""
        for number in range(math.ceil(timeout_s / period_s)):
            found = read()
            if done(found):
                return found
            self.pause(min(period_s, timeout_s - number * period_s))
        raise NoAnswerError(late)

    def _check_error(self, message: Message, error: int) -> None:
        """Raise CommandRefusedError for a non-zero ``error`` code of an acknowledge."""
        if error:
            self.exchanges.refused += 1
            known = {int(code): code for code in self.interface.ack_errors}
            raise CommandRefusedError(message.name, known.get(error, error))


class FoundStar(Protocol):
    """A centroid in an image, with the Hipparcos number of an identified star."""

    @property
    def x_px(self) -> float:
        """Column."""

    @property
    def y_px(self) -> float:
        """Row."""

    @property
    def hipparcos(self) -> int | None:
        """Hipparcos number; None if not identified."""


class DeviceClient(Closable):
    """A device for programs, through any client of its node.

    Attributes:
        client: sends its messages by name.
    """

    picture_sources: tuple[str, ...] = ()
    """Memories that ``picture`` can read, in lower case; empty if there is only one."""

    step_timeout_s = 10.0
    """Time-out of a step of the node in s."""

    def __init__(self, client: Client) -> None:
        """Use ``client``, whose interface must be the device's."""
        self.client = client
        self._on_close = client.close

    def close_with(self, callback: Callable[[], None]) -> None:
        """Have ``close`` call ``callback`` instead of closing the client alone."""
        self._on_close = callback

    def close(self) -> None:
        self._on_close()

    def picture(
        self, source: str | None = None, progress: Progress | None = None
    ) -> "NDArray[np.uint8]":
        """The image (rows, columns) in the device's memory, or in the memory ``source``.

        ``progress`` is called after each block; an exception from it ends the download. Raises
        TargetError for a device or line without image download, and the client's errors.
        """
        raise TargetError(f"{self.client.interface.name} sends no picture")

    def upload(self, picture: "NDArray[np.uint8]", progress: Progress | None = None) -> None:
        """Upload grey values (rows, columns) in place of the device's own image.

        Raises TargetError for a device without upload, ValueError for another shape, and the
        client's errors.
        """
        raise TargetError(f"{self.client.interface.name} has no image upload")

    def stars(self) -> Sequence[FoundStar]:
        """The stars of the latest image.

        Raises TargetError for a device that detects none, and the client's errors.
        """
        raise TargetError(f"{self.client.interface.name} looks for no stars")

    def profile(self) -> Switches:
        """The switches in use, with their profile.

        Raises InterfaceError for a device without switches, and the client's errors.
        """
        return read_switches(self.client.interface.switches, self.client.telemetry(SHOWN))

    def set_profile(self, profile: str) -> None:
        """Use profile "published" or "extended" from the next image on; board switches stay.

        Raises as ``Client.command`` does.
        """
        self.perform(SET_PROFILE, Profile=profile)

    def set_switch(self, switch: str, value: str) -> None:
        """Set a switch of `cubestack registers DEVICE --switches`; raises as ``Client.command``."""
        self.perform(SET_SWITCH, **switch_parameters(switch, value))

    def take_picture(self) -> None:
        """Capture an image of the sky, whatever the result.

        Raises TargetError unless the device is a star tracker, and the client's errors.
        """
        raise TargetError(f"{self.client.interface.name} is no star tracker")

    def observe(self) -> None:
        """Capture an image with each camera and process it; ``latest`` has the result.

        Raises TargetError for a device without images, and the client's errors.
        """
        raise TargetError(f"{self.client.interface.name} takes no images")

    def summary(self, latest: Columns) -> str:
        """The latest result in a sentence: what was found, and how well it is known.

        ``latest`` is what that method returned. Raises the client's errors.
        """
        return ", ".join(f"{name} {value}" for name, value in latest.items() if value is not None)

    def latest(self) -> Columns:
        """The latest result for a log; invalid angles are None.

        Columns of angles end in "_deg"; "image_time_s" is the image's time by the node's clock, if
        known. Raises TargetError for a device without results, and the client's errors.
        """
        raise TargetError(f"{self.client.interface.name} has no results to log")

    def perform(self, name: str, **parameters: object) -> None:
        """Send a telecommand and wait for its end."""
        self._send(name, **parameters)
        self.client.wait_processed(self.step_timeout_s)

    def _send(self, name: str, **parameters: object) -> None:
        """Send a telecommand; if the node's buffer is full, wait and retry once."""
        try:
            self.client.command(name, **parameters)
        except CommandRefusedError as refusal:
            if refusal.code != AckError.BUFFER_FULL:
                raise
            self.client.wait_processed(self.step_timeout_s)
            self.client.command(name, **parameters)

    def _stream(self, name: str, count: int, length: int, progress: Progress | None) -> bytes:
        """The stream of telecommand ``name``: ``count`` blocks of ``length`` bytes."""
        blocks = []
        for block in self.client.stream(name, count):
            if len(block) != length:
                raise BadAnswerError(f"image stream: block of {len(block)} bytes, not {length}")
            blocks.append(block)
            if progress is not None:
                progress(len(blocks), count)
        return b"".join(blocks)

    def _records(self, frame: str, count: int) -> dict[int, dict[str, Value]]:
        """All ``count`` records of a stepping telemetry frame, by star number."""
        records: dict[int, dict[str, Value]] = {}
        reads = 2 * count  # a second round reads records whose answer was lost
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
