"""The queue of a node's jobs, and the telecommands that its main loop takes from there."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.mcu.requests import Pay, Routine, pause
from cubestack.firmware_model.node.hardware import NodeHardware
from cubestack.firmware_model.node.state import SWITCH_COMMANDS, RunningSwitches, Settings

QUEUE_DEPTH = 4  #: most jobs that wait, as the hosts of these nodes expect

STREAM_PAUSE_US = 20_000

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


class CommandExecutor:
    """Effects of telecommands: settings are stored, actions are immediate, routines take time."""

    def __init__(
        self, hardware: NodeHardware, settings: Settings, switches: RunningSwitches[Any]
    ) -> None:
        """Change ``settings`` and ``switches``; a node adds its other telecommands."""
        self._uart = hardware
        self._settings = settings
        self._actions: dict[str, Callable[[QueuedCommand], None]] = dict.fromkeys(
            SWITCH_COMMANDS, lambda c: switches.change(c.message.name, c.values)
        )
        self._routines: dict[str, Callable[[QueuedCommand], Routine[Any]]] = {}
        self._reset_cause: int | None = None
        #: whether a telecommand is being executed, including a reset that it requests
        self.running = False

    @property
    def handled(self) -> frozenset[str]:
        return frozenset({*self._settings.commands, *self._actions, *self._routines})

    def execute(self, command: QueuedCommand) -> Routine[int | None]:
        """Execute ``command``; returns a reset cause if the program must reset."""
        self.running = True
        name = command.message.name
        if name in self._settings.commands:
            self._settings.put(name, command.values)
        if name in self._actions:
            self._actions[name](command)
        if name in self._routines:
            yield from self._routines[name](command)
        yield Pay()
        self.running = self._reset_cause is not None
        return self._reset_cause

    def _await_room(self, backlog_bytes: int) -> Routine[None]:
        """Sleep until the UART has at most ``backlog_bytes`` to send."""
        while self._uart.uart_backlog() > backlog_bytes:
            yield from pause(STREAM_PAUSE_US)
