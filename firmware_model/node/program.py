"""A plain node's program: telecommands one after the other, settings, the node's own telemetry.

A sensor adds the effects of its telecommands and the values of its telemetry. Its tables begin with
those of ``firmware_model.interface.codec.node_messages``.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, ClassVar, TypeAlias

from cubestack.firmware_model.interface import checks
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, Reset, Routine, Sleep
from cubestack.firmware_model.node.hardware import NodeHardware
from cubestack.firmware_model.node.link import BusFlags, LinkFlags, QueueingLink
from cubestack.firmware_model.node.state import NodeState, Settings, identification

POWER_ON, TELECOMMAND = 1, 2  #: causes of a reset

SEND_BUFFER_BYTES = 512

_BUS = BusFlags("TcmdBufferOverflow", "TcmdRefused", "TcmdRefused")
_FLAGS = LinkFlags(
    uart=_BUS,
    i2c=_BUS,
    protocol_error="UartError",
    incomplete="UartError",
    read_without_id="I2cReadWithoutId",
    unknown_command="TcmdRefused",
    bad_parameter="TcmdRefused",
)

Action: TypeAlias = Callable[[dict[str, Any]], Routine[None]]
"""Effect of a telecommand: a generator function of its parameters by name."""

Source: TypeAlias = Callable[[], dict[str, Any]]
"""Returns the values of a telemetry message, in interrupt context, so without waiting."""


class NodeProgram:
    """One run of the program, from reset to reset.

    A telecommand without an action is a setting: its parameters are stored. A telemetry message
    without a source shows settings, if each of its fields is a parameter of one.

    Attributes:
        interface: its messages.
        hardware: peripherals that need no waiting.
        meter: charged with the program's operations.
        state: the error flags.
        settings: the latest parameters of setting telecommands.
        link: the link to the satellite; its methods are the interrupts of UART and I2C.
    """

    interface: ClassVar[Interface]

    def __init__(self, hardware: NodeHardware, meter: Meter) -> None:
        """RAM starts with the reset values that ``interface`` declares."""
        self.hardware = hardware
        self.meter = meter
        interface = self.interface
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
        self._sources: Mapping[str, Source] = {
            "Identification": lambda: identification(interface, node_type, hardware.uptime_us()),
            "ErrorFlags": self.state.flag_values,
            "TcmdProcessed": lambda: self.link.processed(self._busy),
            **self._setting_sources(),
            **self.sources(),
        }
        self.link = QueueingLink(
            hardware, meter, self.state, interface, _FLAGS, SEND_BUFFER_BYTES, self._values
        )
        self._busy = False

    def actions(self) -> Mapping[str, Action]:
        """Effects of telecommands that are no settings, by name."""
        return {}

    def sources(self) -> Mapping[str, Source]:
        """Values of the sensor's telemetry, by name."""
        return {}

    def check(self) -> None:
        """Raise SensorError for a mistake in the declaration; reads all telemetry once."""
        owner, table = type(self), self.meter.table
        checks.check_actions(owner, self.interface, self._actions)
        checks.check_sources(owner, self.interface, self._sources)
        checks.check_charges(owner, table.operations, table.name)

    def main(self) -> Routine[None]:
        while True:
            if not self.link.queue:
                yield Sleep(None)
                continue
            command = self.link.queue.popleft()
            name = command.message.name
            self._busy = True
            if name in self._actions:
                try:
                    yield from self._actions[name](command.values)
                except ValueError as error:
                    package = type(self).__module__.split(".")[0]
                    place = checks.place_of(error.__traceback__, package)
                    raise checks.SensorError(f"{place}{error}") from error
            else:
                self.settings.put(name, command.values)
            yield Pay()
            self._busy = False

    def _values(self, message: Message) -> dict[str, Any]:
        """Values of a telemetry message; SensorError for those that its fields do not hold."""
        source = self._sources[message.name]
        values = source()
        checks.check_values(message, values, lambda: checks.place(source, type(self)))
        return values

    def _setting_sources(self) -> dict[str, Source]:
        """Sources of the telemetry whose fields are all parameters of settings."""
        shown = {
            (field.name, field.type, field.unit, field.scale): name
            for name in self.settings.commands
            for field in self.interface.telecommand(name).fields
        }
        found: dict[str, Source] = {}
        for message in self.interface.telemetries:
            keys = [(field.name, field.type, field.unit, field.scale) for field in message.fields]
            if keys and all(key in shown for key in keys):
                found[message.name] = partial(self._shown, {key[0]: shown[key] for key in keys})
        return found

    def _shown(self, owners: Mapping[str, str]) -> dict[str, Any]:
        return {field: self.settings.get(name, field) for field, name in owners.items()}

    def _reset(self, _values: dict[str, Any]) -> Routine[None]:
        yield Reset(TELECOMMAND)

    def _clear_flags(self, _values: dict[str, Any]) -> Routine[None]:
        self.state.flags.clear()
        yield Pay()
