"""What a node's program keeps: error flags, settings, switches; and its identification."""

from collections.abc import Iterable, Mapping
from typing import Any, Generic

from cubestack.firmware_model.interface.codec import switch_messages
from cubestack.firmware_model.interface.codec.field import InterfaceError, suggestion
from cubestack.firmware_model.interface.codec.message import Interface

FIRMWARE_VERSION = (0, 1)
SERIAL_NUMBER = 1

_U16 = 0xFFFF


class NodeState:
    """RAM that every node's program has: ``flags``, the names of the raised ones."""

    def __init__(self, declared: Iterable[str]) -> None:
        self._declared = frozenset(declared)
        self.flags: set[str] = set()

    def flag_values(self) -> dict[str, bool]:
        return {name: name in self.flags for name in self._declared}

    def raise_flag(self, name: str) -> None:
        """Raise an error flag; KeyError if telemetry does not declare it."""
        if name not in self._declared:
            raise InterfaceError(
                f"no error flag {name!r} in telemetry; {suggestion(name, sorted(self._declared))}"
            )
        self.flags.add(name)


def identification(interface: Interface, node_type: int, uptime_us: int) -> dict[str, Any]:
    """Values of telemetry Identification; the runtime wraps after 65 536 seconds."""
    seconds, milliseconds = divmod(uptime_us // 1000, 1000)
    return {
        "NodeType": node_type,
        "InterfaceVersion": interface.version,
        "FirmwareVersionMajor": FIRMWARE_VERSION[0],
        "FirmwareVersionMinor": FIRMWARE_VERSION[1],
        "RuntimeMilliseconds": milliseconds,
        "RuntimeSeconds": seconds & _U16,
    }


class Settings:
    """Current parameters of the setting telecommands ``commands``.

    They are stored as the telecommands' own parameter bytes, so a new setting is one more name.
    """

    def __init__(self, interface: Interface, commands: Iterable[str]) -> None:
        self.commands = tuple(commands)
        self._messages = {name: interface.telecommand(name) for name in self.commands}
        self._values: dict[str, dict[str, Any]] = {}
        self.clear()

    def clear(self) -> None:
        self._values = {name: dict(m.reset_values()) for name, m in self._messages.items()}

    def get(self, command: str, field: str) -> Any:
        """A parameter of a setting telecommand; InterfaceError for an unknown one."""
        try:
            return self._values[command][field]
        except KeyError:
            known = self._values.get(command, self._values)
            hint = suggestion(field if command in self._values else command, list(known))
            raise InterfaceError(f"no setting {command!r}, {field!r}; {hint}") from None

    def all(self, *commands: str) -> dict[str, Any]:
        """All parameters of ``commands``, whose names must differ."""
        return {name: value for key in commands for name, value in self._values[key].items()}

    def put(self, command: str, values: Mapping[str, Any]) -> None:
        self._values[command] = dict(values)

    def size(self, *commands: str) -> int:
        """Bytes of the parameters of ``commands``, in their order; of all if none is named."""
        return sum(self._messages[name].length for name in commands or self.commands)

    def pack(self, *commands: str) -> bytes:
        """Parameters of ``commands``, ``size`` bytes."""
        names = commands or self.commands
        return b"".join(self._messages[name].pack(**self._values[name]) for name in names)

    def unpack(self, data: bytes, *commands: str) -> None:
        """Restore the result of ``pack``; another length raises ValueError."""
        if len(data) != self.size(*commands):
            raise ValueError(f"stored settings have {len(data)} bytes, not {self.size(*commands)}")
        for name in commands or self.commands:
            message = self._messages[name]
            self._values[name] = message.unpack(data[: message.length])
            data = data[message.length :]


#: Telecommands that ``RunningSwitches.change`` executes.
SWITCH_COMMANDS = (switch_messages.SET_PROFILE, switch_messages.SET_SWITCH)


class RunningSwitches(Generic[switch_messages.SwitchesT]):
    """Switches in use; a user of a switch reads ``now`` when it begins with an image.

    The main loop executes telecommands between its other tasks, so never during one.
    """

    def __init__(self, at_power_up: switch_messages.SwitchesT) -> None:
        self._at_power_up = self.now = at_power_up  #: now: current switches

    def change(self, telecommand: str, values: Mapping[str, Any]) -> None:
        self.now = switch_messages.apply_command(self.now, telecommand, values)

    def forget(self) -> None:
        self.now = self._at_power_up
