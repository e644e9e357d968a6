"""The settings that telecommands change: stored as the telecommands' own parameter bytes.

Kept in the battery-domain retention registers over the software reset that ends every iteration
(CubeStar thesis, section 5.3.6, and appendix E: "retention registers in backup power domain"), and
in flash by SaveConfig. The layout derives from the telecommand table, so a new setting is one name
in ``SETTING_COMMANDS``.
"""

from collections.abc import Mapping
from typing import Any

from cubestack.firmware_model.interface.cubestar import INTERFACE

__all__ = ["SETTING_COMMANDS", "Settings"]

#: Telecommands whose parameters are kept.
SETTING_COMMANDS = (
    "setDelayTimerTimeout",
    "Exposure",
    "setFocalLength",
    "setFocalLengthComponents",
    "setPrincipalPoint",
    "setRadialDistortionGains",
    "setTangentalDistortionGains",
    "ImageBlockSet",
    "setDetectionRegion",
    "setDetectionThresholds",
    "setStarPixels",
    "setDetectionVariables",
    "setIDMode",
    "setTrackingMode",
    "setIDMargin",
    "SelectImageBank",
    "SetFrameRate",
    "SetDiscardDelay",
    "SetCameraRegisterPage",
)

_MESSAGES = {name: INTERFACE.telecommand(name) for name in SETTING_COMMANDS}


class Settings:
    """Current parameters of every setting telecommand."""

    SIZE = sum(message.length for message in _MESSAGES.values())

    def __init__(self) -> None:
        """Start with the reset values that the telecommand table declares."""
        self._values: dict[str, dict[str, Any]] = {}
        self.clear()

    def clear(self) -> None:
        """Go back to the reset values."""
        self._values = {name: dict(message.reset_values()) for name, message in _MESSAGES.items()}

    def get(self, command: str, field: str) -> Any:
        """Value of parameter ``field`` of telecommand ``command``."""
        return self._values[command][field]

    def all(self, command: str) -> dict[str, Any]:
        """All parameters of telecommand ``command``."""
        return dict(self._values[command])

    def put(self, command: str, values: Mapping[str, Any]) -> None:
        """Store all parameters of ``command``."""
        self._values[command] = dict(values)

    def pack(self) -> bytes:
        """All parameters, ``SIZE`` bytes."""
        return b"".join(m.pack(**self._values[name]) for name, m in _MESSAGES.items())

    def unpack(self, data: bytes) -> None:
        """Restore what ``pack`` gave; other lengths raise ValueError."""
        if len(data) != self.SIZE:
            raise ValueError(f"stored settings have {len(data)} bytes, not {self.SIZE}")
        offset = 0
        for name, message in _MESSAGES.items():
            self._values[name] = message.unpack(data[offset : offset + message.length])
            offset += message.length
