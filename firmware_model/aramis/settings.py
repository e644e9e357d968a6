"""The settings that telecommands change: stored as the telecommands' own parameter bytes.

SaveConfig writes them to a flash page with their CRC-32 behind; the body rotation has a page of its
own, written as soon as it is set (AraMiS thesis, section 2.2, inputAOCSparameters).
"""

from collections.abc import Mapping
from typing import Any
from zlib import crc32

from cubestack.firmware_model.interface.aramis import INTERFACE
from cubestack.firmware_model.interface.aramis.telemetry import SETTINGS_SHOWN
from cubestack.firmware_model.mcu.requests import FlashStore

__all__ = ["BODY_PAGE", "CONFIG_PAGE", "SETTING_COMMANDS", "Settings"]

#: Telecommands whose parameters are kept.
SETTING_COMMANDS = tuple(SETTINGS_SHOWN.values())

CONFIG_PAGE = "config"
BODY_PAGE = "body"

BODY_COMMAND = "SetBodyRotation"

_MESSAGES = {name: INTERFACE.telecommand(name) for name in SETTING_COMMANDS}
_SAVED = [name for name in SETTING_COMMANDS if name != BODY_COMMAND]


class Settings:
    """Current parameters of every setting telecommand.

    Attributes:
        damaged: whether a page in flash did not fit its checksum when it was read last.
    """

    def __init__(self, flash: FlashStore) -> None:
        """Take what ``flash`` holds, else the declared reset values."""
        self._flash = flash
        self.damaged = False
        self._values: dict[str, dict[str, Any]] = {}
        self.load()

    def get(self, command: str, field: str) -> Any:
        """Value of parameter ``field`` of telecommand ``command``."""
        return self._values[command][field]

    def all(self, command: str) -> dict[str, Any]:
        """All parameters of telecommand ``command``."""
        return dict(self._values[command])

    def put(self, command: str, values: Mapping[str, Any]) -> None:
        """Store all parameters of ``command``; the body rotation in flash too."""
        self._values[command] = dict(values)
        if command == BODY_COMMAND:
            self._write(BODY_PAGE, [BODY_COMMAND])

    def save(self) -> None:
        """Write all but the body rotation to flash."""
        self._write(CONFIG_PAGE, _SAVED)

    def erase(self) -> None:
        """Erase what ``save`` wrote, and return to the reset values."""
        self._flash.erase(CONFIG_PAGE)
        self.load()

    def load(self) -> None:
        """Read both pages; reset values where one is erased or damaged."""
        self.damaged = False
        self._values = {name: dict(message.reset_values()) for name, message in _MESSAGES.items()}
        self._read(CONFIG_PAGE, _SAVED)
        self._read(BODY_PAGE, [BODY_COMMAND])

    def _write(self, page: str, commands: list[str]) -> None:
        data = b"".join(_MESSAGES[name].pack(**self._values[name]) for name in commands)
        self._flash.write(page, data + crc32(data).to_bytes(4, "little"))

    def _read(self, page: str, commands: list[str]) -> None:
        stored = self._flash.read(page)
        if stored is None:
            return
        data, checksum = stored[:-4], int.from_bytes(stored[-4:], "little")
        if len(data) != sum(_MESSAGES[name].length for name in commands) or crc32(data) != checksum:
            self.damaged = True
            return
        for name in commands:
            message = _MESSAGES[name]
            self._values[name] = message.unpack(data[: message.length])
            data = data[message.length :]
