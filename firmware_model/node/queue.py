"""Jobs that wait for a node's main loop."""

from collections import deque
from dataclasses import dataclass
from typing import Any, TypeVar

from cubestack.firmware_model.interface.codec.message import Message

QUEUE_DEPTH = 4  #: most jobs that wait, as the hosts of these nodes expect

Job = TypeVar("Job")


@dataclass(frozen=True)
class QueuedCommand:
    """An accepted telecommand with its decoded parameters and its time of arrival."""

    message: Message
    values: dict[str, Any]
    received_us: int = 0


class BoundedQueue(deque[Job]):
    """Jobs in their order, at most ``QUEUE_DEPTH``."""

    @property
    def full(self) -> bool:
        return len(self) >= QUEUE_DEPTH

    def put(self, job: Job) -> bool:
        """Append ``job``; False if the queue is full."""
        accepted = not self.full
        if accepted:
            self.append(job)
        return accepted
