"""CubeStar's link to the host: its counters survive resets, and no reset interrupts a message."""

from collections.abc import Callable, Collection
from typing import Any

from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.tasks import TASKS
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.node.link import BusFlags, LinkFlags, QueueingLink

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
