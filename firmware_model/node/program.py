"""A plain node's program: telecommands one after the other, settings, the node's own telemetry.

A sensor adds what its telecommands do and what its telemetry says. Its tables begin with those of
``firmware_model.interface.codec.node_messages``.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from typing import Any, TypeAlias

from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.firmware_model.interface.codec.node_codes import AckError
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, Reset, Routine, Sleep
from cubestack.firmware_model.node.hardware import NodeHardware
from cubestack.firmware_model.node.identification import identification
from cubestack.firmware_model.node.link import BusFlags, LinkFlags, SatelliteLink
from cubestack.firmware_model.node.queue import BoundedQueue
from cubestack.firmware_model.node.settings import Settings
from cubestack.firmware_model.node.state import NodeState

POWER_ON, TELECOMMAND = 1, 2
"""Causes of a reset."""

SEND_BUFFER_BYTES = 512

_BUS = BusFlags("TcmdBufferOverflow", "TcmdRefused", "TcmdRefused")
_FLAGS = LinkFlags(
    uart=_BUS,
    i2c=_BUS,
    protocol_error="UartError",
    incomplete="UartError",
    read_without_id="I2cReadWithoutId",
    unknown_command="TcmdRefused",
)

Action: TypeAlias = Callable[[dict[str, Any]], Routine[None]]
"""What a telecommand does, given its parameters."""

Source: TypeAlias = Callable[[], dict[str, Any]]
"""Gives the values of a telemetry message, in interrupt context, so that nothing waits."""


class PlainLink(SatelliteLink):
    """Queues telecommands and answers telemetry at once.

    Attributes:
        queue: accepted telecommands, each with its parameters.
        latest: ID and error code of the latest telecommand.
    """

    def __init__(
        self,
        hardware: NodeHardware,
        meter: Meter,
        state: NodeState,
        interface: Interface,
        telemetry: Callable[[Message], dict[str, Any]],
    ) -> None:
        """Serve ``interface``; ``telemetry`` gives the values of a message."""
        super().__init__(hardware, meter, state, interface, _FLAGS, SEND_BUFFER_BYTES)
        self._telemetry = telemetry
        self.queue: BoundedQueue[tuple[Message, dict[str, Any]]] = BoundedQueue()
        self.latest = (0, AckError.OK)

    def _values(self, message: Message) -> dict[str, Any]:
        return self._telemetry(message)

    def _enqueue(self, message: Message, values: dict[str, Any]) -> bool:
        return self.queue.put((message, values))

    def _refusals(self, message: Message, values: dict[str, Any]) -> Collection[str]:
        return [flag or "TcmdRefused" for flag in super()._refusals(message, values)]

    def _accept(self, identifier: int, parameters: bytes, bus: BusFlags) -> AckError:
        error = super()._accept(identifier, parameters, bus)
        self.latest = identifier, error
        return error


class NodeProgram(ABC):
    """One life of the program, from reset to reset.

    A telecommand without an action is a setting: its parameters are kept.

    Attributes:
        meter: charged with what the program does.
        state: the error flags.
        settings: the latest parameters of setting telecommands.
        link: the satellite's side; its methods are the interrupts of UART and I2C.
    """

    def __init__(self, hardware: NodeHardware, meter: Meter, interface: Interface) -> None:
        """Reset: RAM starts with the reset values that ``interface`` declares."""
        self.meter = meter
        flags = interface.telemetry("ErrorFlags").fields
        self.state = NodeState(field.flag for field in flags)
        self._actions: dict[str, Action] = {
            "Reset": self._reset,
            "ClearErrorFlags": self._clear_flags,
            **self.actions(),
        }
        names = [message.name for message in interface.telecommands]
        self.settings = Settings(interface, (name for name in names if name not in self._actions))
        node_type = int(interface.telemetry("Identification").reset_values()["NodeType"])
        sources: Mapping[str, Source] = {
            "Identification": lambda: identification(interface, node_type, hardware.uptime_us()),
            "ErrorFlags": self.state.flag_values,
            "TcmdProcessed": self._processed,
            **self.sources(),
        }
        self.link = PlainLink(
            hardware, meter, self.state, interface, lambda message: sources[message.name]()
        )
        self._busy = False

    @abstractmethod
    def actions(self) -> Mapping[str, Action]:
        """What telecommands do, by name."""

    @abstractmethod
    def sources(self) -> Mapping[str, Source]:
        """Values of the sensor's telemetry, by name."""

    def main(self) -> Routine[None]:
        """Execute one telecommand after the other."""
        while True:
            if not self.link.queue:
                yield Sleep(None)
                continue
            message, values = self.link.queue.popleft()
            self._busy = True
            if message.name in self._actions:
                yield from self._actions[message.name](values)
            else:
                self.settings.put(message.name, values)
            yield Pay()
            self._busy = False

    def _reset(self, _values: dict[str, Any]) -> Routine[None]:
        yield Reset(TELECOMMAND)

    def _clear_flags(self, _values: dict[str, Any]) -> Routine[None]:
        self.state.flags.clear()
        yield Pay()

    def _processed(self) -> dict[str, Any]:
        waiting = len(self.link.queue)
        latest, error = self.link.latest
        done = not waiting and not self._busy
        return {"Processed": int(done), "Waiting": waiting, "Latest": latest, "Error": error}
