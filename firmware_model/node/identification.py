"""Telemetry Identification, the same for every node of the family."""

from typing import Any

from cubestack.firmware_model.interface.codec.message import Interface

FIRMWARE_VERSION = (0, 1)
SERIAL_NUMBER = 1

_U16 = 0xFFFF


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
