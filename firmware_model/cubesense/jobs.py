"""What waits for the main loop: telecommands, measurements, and streams that want to be fed.

Links put jobs in interrupt context, the main loop takes them one after the other. Four wait at
most, as the node protocol's hosts expect. Streams do not count among them: each has one place
of its own, and gets its turn when nothing else waits.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubesense.codes import Camera, ImageSize, Sram
from cubestack.firmware_model.mcu.requests import Routine
from cubestack.firmware_model.node.queue import BoundedQueue


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """A frame that a host wants prepared, of the picture in ``sram`` as a square of ``size``."""

    sram: Sram
    size: ImageSize
    frame: int


@dataclass(eq=False)
class TelecommandJob:
    """An accepted telecommand.

    Attributes:
        frame: the frame that it asks for, if any.
        latest: no telecommand came after it, so telemetry TcmdProcessed speaks of this one.
    """

    message: Message
    values: dict[str, Any]
    frame: FrameRequest | None = None
    latest: bool = False


@dataclass(frozen=True)
class Measure:
    """A measurement that a telemetry request or a register asked for."""

    camera: Camera
    sram: Sram
    detect: bool


@dataclass(frozen=True, eq=False)
class Background:
    """A piece of a stream: ``work`` does as much as there is room for, and returns."""

    work: Callable[[], Routine[None]]


Job = TelecommandJob | Measure | Background


class JobQueue:
    """Jobs in their order, then streams in turn."""

    def __init__(self) -> None:
        """Make an empty queue."""
        self._jobs: BoundedQueue[TelecommandJob | Measure] = BoundedQueue()
        self._streams: deque[Background] = deque()

    def __len__(self) -> int:
        """How many wait."""
        return len(self._jobs) + len(self._streams)

    @property
    def full(self) -> bool:
        """Whether no further job is accepted."""
        return self._jobs.full

    def put(self, job: TelecommandJob | Measure) -> bool:
        """Append ``job``; False when the queue is full."""
        return self._jobs.put(job)

    def request(self, stream: Background, *, next_turn: bool = False) -> bool:
        """Let ``stream`` have a turn; ``next_turn``: the next one. False when it waits already."""
        if stream in self._streams:
            return False
        if next_turn:
            self._streams.appendleft(stream)
        else:
            self._streams.append(stream)
        return True

    def pop(self) -> Job:
        """Take the next; IndexError when none waits."""
        return self._jobs.popleft() if self._jobs else self._streams.popleft()
