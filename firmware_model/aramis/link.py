"""AraMiS' link to the host: urgent telecommands, and directions that must be unit vectors.

The urgent part of an accepted telecommand is executed as soon as it is queued.
"""

import math
from collections.abc import Callable, Collection
from typing import Any

from cubestack.firmware_model.aramis.hardware import AramisHardware
from cubestack.firmware_model.aramis.state import State
from cubestack.firmware_model.interface.aramis import BLOCK_BYTES, INTERFACE
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.node.commands import QueuedCommand
from cubestack.firmware_model.node.link import BusFlags, LinkFlags, QueueingLink

SEND_BUFFER_BYTES = 8 * BLOCK_BYTES  #: assumed

_BUS = BusFlags("TcmdBufferOverflow", "TcmdLengthError", "TcmdLengthError", "TlmIdError")
_FLAGS = LinkFlags(
    uart=_BUS,
    i2c=_BUS,
    protocol_error="UartProtocolError",
    incomplete="UartIncomplete",
    read_without_id="I2cReadWithoutId",
    timeout="UartTimeout",
    unknown_command="TcmdIdError",
    bad_parameter="ParameterError",
)

_LENGTHS = {
    "GetAttitudeNearVector": (0.9, 1.1, "DirectionError"),
    "SetBodyRotation": (0.99, 1.01, "RotationError"),
}
"""Shortest and longest vector of a telecommand, and the flag for others."""


class AramisLink(QueueingLink):
    """Counts messages and checks directions; ``urgent`` runs in the interrupt."""

    state: State

    def __init__(
        self,
        hardware: AramisHardware,
        meter: Meter,
        state: State,
        telemetry: Callable[[Message], dict[str, Any]],
        urgent: Callable[[QueuedCommand], None],
    ) -> None:
        """``urgent`` is called at once for each accepted telecommand."""
        super().__init__(hardware, meter, state, INTERFACE, _FLAGS, SEND_BUFFER_BYTES, telemetry)
        self._urgent = urgent

    def _values(self, message: Message) -> dict[str, Any] | None:
        self.state.telemetry += 1
        return super()._values(message)

    def _refusals(self, message: Message, values: dict[str, Any]) -> Collection[str | None]:
        flags = {*super()._refusals(message, values)}
        if message.name in _LENGTHS:
            shortest, longest, flag = _LENGTHS[message.name]
            length = math.hypot(*(float(value) for value in values.values()))
            if not shortest <= length <= longest:
                flags.add(flag)
        return flags

    def _enqueue(self, message: Message, values: dict[str, Any]) -> bool:
        accepted = super()._enqueue(message, values)
        if accepted:
            self._urgent(self.queue[-1])
            self.state.telecommands += 1
        return accepted
