"""Settings that telecommands change, stored as the telecommands' own parameter bytes.

The layout derives from the telecommand table, so a new setting is one more name.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from cubestack.firmware_model.interface.codec.field import InterfaceError, suggestion
from cubestack.firmware_model.interface.codec.message import Interface


class Settings:
    """Current parameters of the setting telecommands ``commands``."""

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
