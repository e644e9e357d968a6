"""What waits for a node's main loop."""

from collections import deque
from dataclasses import dataclass
from typing import Any, TypeVar

from cubestack.firmware_model.interface.codec.message import Message

QUEUE_DEPTH = 4
"""So many wait at most, as the hosts of these nodes expect."""

Job = TypeVar("Job")


@dataclass(frozen=True)
class QueuedCommand:
    """An accepted telecommand with its decoded parameters, and the uptime when it came."""

    message: Message
    values: dict[str, Any]
    came_us: int = 0


class BoundedQueue(deque[Job]):
    """Jobs in their order, ``QUEUE_DEPTH`` at most."""

    @property
    def full(self) -> bool:
        """Whether no further job is accepted."""
        return len(self) >= QUEUE_DEPTH

    def put(self, job: Job) -> bool:
        """Append ``job``; False when the queue is full."""
        accepted = not self.full
        if accepted:
            self.append(job)
        return accepted
