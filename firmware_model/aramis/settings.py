"""The settings that telecommands change, and their pages in flash.

SaveConfig writes them to a flash page followed by their CRC-32; the body rotation has its own page,
written as soon as it is set (AraMiS thesis, section 2.2, inputAOCSparameters).
"""

from collections.abc import Mapping
from typing import Any
from zlib import crc32

from cubestack.firmware_model.interface.aramis import INTERFACE
from cubestack.firmware_model.interface.aramis.telemetry import SETTINGS_SHOWN
from cubestack.firmware_model.mcu.memory import FlashStore
from cubestack.firmware_model.node.state import Settings

#: Telecommands whose parameters are stored.
SETTING_COMMANDS = tuple(SETTINGS_SHOWN.values())

CONFIG_PAGE = "config"
BODY_PAGE = "body"

BODY_COMMAND = "SetBodyRotation"

_SAVED = tuple(name for name in SETTING_COMMANDS if name != BODY_COMMAND)


class StoredSettings(Settings):
    """Current parameters of every setting telecommand.

    Attributes:
        damaged: a page in flash did not match its checksum when it was last read.
    """

    def __init__(self, flash: FlashStore) -> None:
        """Load the settings from ``flash``, else the declared reset values."""
        super().__init__(INTERFACE, SETTING_COMMANDS)
        self._flash = flash
        self.load()

    def put(self, command: str, values: Mapping[str, Any]) -> None:
        """Store all parameters of ``command``; the body rotation in flash too."""
        super().put(command, values)
        if command == BODY_COMMAND:
            self._write(BODY_PAGE, (BODY_COMMAND,))

    def save(self) -> None:
        self._write(CONFIG_PAGE, _SAVED)

    def erase(self) -> None:
        """Erase the page of ``save``, and return to the reset values."""
        self._flash.erase(CONFIG_PAGE)
        self.load()

    def load(self) -> None:
        """Read both pages; an erased or damaged one is replaced by reset values."""
        self.damaged = False
        self.clear()
        self._read(CONFIG_PAGE, _SAVED)
        self._read(BODY_PAGE, (BODY_COMMAND,))

    def _write(self, page: str, commands: tuple[str, ...]) -> None:
        data = self.pack(*commands)
        self._flash.write(page, data + crc32(data).to_bytes(4, "little"))

    def _read(self, page: str, commands: tuple[str, ...]) -> None:
        stored = self._flash.read(page)
        if stored is None:
            return
        data, checksum = stored[:-4], int.from_bytes(stored[-4:], "little")
        if len(data) == self.size(*commands) and crc32(data) == checksum:
            self.unpack(data, *commands)
        else:
            self.damaged = True
