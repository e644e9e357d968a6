"""Jobs that wait for the main loop: telecommands, measurements, and pieces of streams.

Links put jobs in interrupt context, the main loop takes them one after the other. At most four
wait, as the node protocol's hosts expect. Streams are not counted: each has a separate place, and
gets its turn when nothing else waits.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubesense.codes import Camera, ImageSize, Sram
from cubestack.firmware_model.mcu.requests import Routine
from cubestack.firmware_model.node.commands import BoundedQueue


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """A requested frame of the image in ``sram`` as a square of ``size``."""

    sram: Sram
    size: ImageSize
    frame: int


@dataclass(eq=False)
class TelecommandJob:
    """An accepted telecommand."""

    message: Message
    values: dict[str, Any]
    frame: FrameRequest | None = None  #: the requested frame, if any
    latest: bool = False  #: it is the latest telecommand, which telemetry TcmdProcessed describes


@dataclass(frozen=True)
class Measure:
    """A measurement requested by telemetry or a register."""

    camera: Camera
    sram: Sram
    detect: bool


@dataclass(frozen=True, eq=False)
class Background:
    """A piece of a stream: ``work`` sends as much as there is room for, and returns."""

    work: Callable[[], Routine[None]]


Job = TelecommandJob | Measure | Background


class JobQueue:
    """Jobs in their order, then streams in turn."""

    def __init__(self) -> None:
        self._jobs: BoundedQueue[TelecommandJob | Measure] = BoundedQueue()
        self._streams: deque[Background] = deque()

    def __len__(self) -> int:
        return len(self._jobs) + len(self._streams)

    @property
    def full(self) -> bool:
        return self._jobs.full

    def put(self, job: TelecommandJob | Measure) -> bool:
        return self._jobs.put(job)

    def request(self, stream: Background, *, next_turn: bool = False) -> bool:
        """Queue ``stream``, with ``next_turn`` as the first; False if it waits already."""
        if stream in self._streams:
            return False
        if next_turn:
            self._streams.appendleft(stream)
        else:
            self._streams.append(stream)
        return True

    def pop(self) -> Job:
        """Remove and return the next job; raises IndexError if none waits."""
        return self._jobs.popleft() if self._jobs else self._streams.popleft()
