"""CubeStar's link to the host: its counters survive resets, and no reset interrupts a message."""

from collections.abc import Callable, Collection
from typing import Any, NamedTuple

from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.codes import TaskStatus
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.node.link import BusFlags, LinkFlags, QueueingLink


class Task(NamedTuple):
    """Values of telemetry TaskStatus: a telecommand is in progress, done, failed.

    A task without a failed state ends as done: the error flags report the outcome.
    """

    begun: TaskStatus
    done: TaskStatus
    failed: TaskStatus | None = None


_WRITE = Task(TaskStatus.WRITING_SENSOR, TaskStatus.SENSOR_WRITTEN)
_READ = Task(TaskStatus.READING_SENSOR, TaskStatus.SENSOR_READ)

#: Telecommands that report their progress in no other way. Captures, detection, identification and
#: attitude estimate report theirs step by step, also in the loop. A parameter out of range fails at
#: once, with the task's failed state, if any.
TASKS = {
    "Exposure": Task(
        TaskStatus.SETTING_EXPOSURE, TaskStatus.EXPOSURE_SET, TaskStatus.EXPOSURE_FAILED
    ),
    "WriteTo_IS_Register": _WRITE,
    "WriteCameraRegister": _WRITE,
    "ReadFrom_IS_Register": _READ,
    "SelectCameraRegister": _READ,
    # One upload is many telecommands: it is in progress until a block was received.
    "UploadImage": Task(
        TaskStatus.RECEIVING_IMAGE, TaskStatus.RECEIVING_IMAGE, TaskStatus.RECEIVING_FAILED
    ),
    "UploadBlock": Task(
        TaskStatus.RECEIVING_IMAGE, TaskStatus.IMAGE_RECEIVED, TaskStatus.RECEIVING_FAILED
    ),
    "ImageBlockSet": Task(TaskStatus.SETTING_BLOCK, TaskStatus.BLOCK_SET, TaskStatus.BLOCK_FAILED),
    "TestSRAM": Task(TaskStatus.TESTING_SRAM, TaskStatus.SRAM_TESTED),
    "CaptureTestPatern": Task(
        TaskStatus.CAPTURING_PATTERN, TaskStatus.PATTERN_CAPTURED, TaskStatus.PATTERN_FAILED
    ),
    "SelectBestStars": Task(
        TaskStatus.FINDING_BEST_STARS, TaskStatus.BEST_STARS_FOUND, TaskStatus.BEST_STARS_FAILED
    ),
    "StreamDownImage": Task(TaskStatus.STREAMING_IMAGE, TaskStatus.IMAGE_STREAMED),
}


SEND_BUFFER_BYTES = 2048  #: assumed: a third of a second at the default baud rate

_FLAGS = LinkFlags(
    uart=BusFlags(
        "UART_TcmdBufOfError", "UART_Tcmd_TooFewParm", "UART_Tcmd_TooManyParm", "TlmIDError"
    ),
    i2c=BusFlags("I2C_TcmdBufOFError", "I2C_TCMD_TooFewParm", "I2C_TCMD_TooManyparm", "TlmIDError"),
    protocol_error="UART_ProtocolError",
    incomplete="UART_MsgIncomplete",
    read_without_id="I2C_WaitForIDReadRequestError",
    timeout="UART_RXTimeout",
    unknown_command="TcmdIDError",
)


class CubeStarLink(QueueingLink):
    """Counts messages in the retained state; a rejected task sets ``TaskStatus``."""

    state: State

    def __init__(
        self, meter: Meter, state: State, telemetry: Callable[[Message], dict[str, Any] | None]
    ) -> None:
        super().__init__(
            state.hardware, meter, state, INTERFACE, _FLAGS, SEND_BUFFER_BYTES, telemetry
        )

    @property
    def idle(self) -> bool:
        """True if a reset would interrupt neither a message nor an answer."""
        return not (self.receiving or self.queue or self.hardware.uart_backlog())

    def _refusals(self, message: Message, values: dict[str, Any]) -> Collection[str | None]:
        flags = super()._refusals(message, values)
        if flags and message.name in TASKS:
            self.state.task_status = TASKS[message.name].failed or self.state.task_status
        return flags

    def _values(self, message: Message) -> dict[str, Any] | None:
        values = super()._values(message)
        self.state.retained.telemetry += values is not None
        return values

    def _enqueue(self, message: Message, values: dict[str, Any]) -> bool:
        accepted = super()._enqueue(message, values)
        self.state.retained.telecommands += accepted
        return accepted
