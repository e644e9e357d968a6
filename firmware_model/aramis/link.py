"""AraMiS' link to the host: commands that can not wait, and directions that must be unit vectors.

An accepted telecommand of which something can not wait is acted upon at once, before it is queued.
"""

import math
from collections.abc import Callable, Collection
from typing import Any

from cubestack.firmware_model.aramis.hardware import AramisHardware
from cubestack.firmware_model.aramis.state import State
from cubestack.firmware_model.interface.aramis import BLOCK_BYTES, INTERFACE, AckError
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.node.link import BusFlags, LinkFlags, SatelliteLink
from cubestack.firmware_model.node.queue import BoundedQueue, QueuedCommand

SEND_BUFFER_BYTES = 8 * BLOCK_BYTES
"""What the UART may still have to send: assumed."""

_BUS = BusFlags("TcmdBufferOverflow", "TcmdLengthError", "TcmdLengthError", "TlmIdError")
_FLAGS = LinkFlags(
    uart=_BUS,
    i2c=_BUS,
    protocol_error="UartProtocolError",
    incomplete="UartIncomplete",
    read_without_id="I2cReadWithoutId",
    timeout="UartTimeout",
    unknown_command="TcmdIdError",
)

_LENGTHS = {
    "GetAttitudeNearVector": (0.9, 1.1, "DirectionError"),
    "SetBodyRotation": (0.99, 1.01, "RotationError"),
}
"""Shortest and longest vector that a telecommand may carry, and the flag that others raise."""


class AramisLink(SatelliteLink):
    """Decodes what the host sends and answers it.

    Attributes:
        queue: accepted telecommands for the main loop.
        latest: ID and error code of the latest telecommand.
    """

    def __init__(
        self,
        hardware: AramisHardware,
        meter: Meter,
        state: State,
        telemetry: Callable[[Message], dict[str, Any]],
        urgent: Callable[[QueuedCommand], None],
    ) -> None:
        """Serve.

        Args:
            hardware: the UART, and the main loop's sleep.
            meter: charged.
            state: flags and counters.
            telemetry: gives the values of a message.
            urgent: told of each accepted telecommand at once, before it is queued.
        """
        super().__init__(hardware, meter, state, INTERFACE, _FLAGS, SEND_BUFFER_BYTES)
        self._state = state
        self._telemetry = telemetry
        self._urgent = urgent
        self.queue: BoundedQueue[QueuedCommand] = BoundedQueue()
        self.latest = (0, AckError.OK)

    def _values(self, message: Message) -> dict[str, Any]:
        self._state.telemetry += 1
        return self._telemetry(message)

    def _accept(self, identifier: int, parameters: bytes, bus: BusFlags) -> AckError:
        error = super()._accept(identifier, parameters, bus)
        self.latest = identifier, error
        return error

    def _refusals(self, message: Message, values: dict[str, Any]) -> Collection[str | None]:
        flags = {flag or "ParameterError" for flag in super()._refusals(message, values)}
        if message.name in _LENGTHS:
            shortest, longest, flag = _LENGTHS[message.name]
            length = math.hypot(*(float(value) for value in values.values()))
            if not shortest <= length <= longest:
                flags.add(flag)
        return flags

    def _enqueue(self, message: Message, values: dict[str, Any]) -> bool:
        if self.queue.full:
            return False
        command = QueuedCommand(message, values, self._hardware.uptime_us())
        self._urgent(command)
        self.queue.append(command)
        self._state.telecommands += 1
        return True
