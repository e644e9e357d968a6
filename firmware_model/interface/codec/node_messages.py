"""Messages that a plain node has beside its own: identification, errors, progress.

They are those of the CubeSpace family's nodes; ``firmware_model.node.program`` serves them.
"""

from collections.abc import Iterable, Mapping
from enum import IntEnum
from types import MappingProxyType
from typing import Any

from cubestack.firmware_model.interface.codec.field import Flag, enum8, flags_at, u8, u16
from cubestack.firmware_model.interface.codec.message import Interface, Message


class AckError(IntEnum):
    """Error byte of a telecommand's acknowledge."""

    OK = 0
    INVALID_ID = 1
    WRONG_LENGTH = 2
    BAD_PARAMETER = 3
    BUFFER_FULL = 4  # an extension: the published list ends at 3


#: Error flags of its link to the host, with their causes.
NODE_FLAGS = {
    "UartError": "byte outside of a frame, or a frame that never ended",
    "I2cReadWithoutId": "read with no telemetry ID written before",
    "TcmdBufferOverflow": "telecommand while the command buffer was full",
    "TcmdRefused": "telecommand with an unknown ID, a wrong length or a parameter out of range",
}

IDENTIFICATION = Message(128, "Identification", "type, versions and uptime").of(
    u8("NodeType", "type of node"),
    u8("InterfaceVersion", "version of this interface"),
    u8("FirmwareVersionMajor", "firmware version, major"),
    u8("FirmwareVersionMinor", "firmware version, minor"),
    u16("RuntimeMilliseconds", "uptime, part below one second", "ms"),
    u16("RuntimeSeconds", "uptime, whole seconds, modulo 65536", "s"),
)

TCMD_PROCESSED = Message(131, "TcmdProcessed", "pending telecommands and latest acknowledge").of(
    u8("Processed", "1: all are done"),
    u8("Waiting", "waiting telecommands"),
    u8("Latest", "ID of the latest telecommand, accepted or not"),
    enum8("Error", "its error code", choices=AckError),
)

NODE_TELECOMMANDS = (
    Message(1, "Reset", "restart the program", risk="the program restarts"),
    Message(2, "ClearErrorFlags", "lower all error flags"),
)


def node_telemetry(node_type: int, own_flags: Mapping[str, str]) -> tuple[Message, ...]:
    """Telemetry 128 to 131 of a node; its ``own_flags`` follow those of the link."""
    flags = {**NODE_FLAGS, **own_flags}
    return (
        IDENTIFICATION.of(
            u8("NodeType", f"always {node_type}", reset=node_type), *IDENTIFICATION.fields[1:]
        ),
        Message(130, "ErrorFlags", "errors since ClearErrorFlags").of(
            *flags_at(
                Flag(bit, name, flags[name], "link" if name in NODE_FLAGS else "node")
                for bit, name in enumerate(flags)
            )
        ),
        TCMD_PROCESSED,
    )


def node_interface(
    name: str,
    *,
    i2c_address: int,
    telecommands: Iterable[Message],
    telemetries: Iterable[Message],
    flags: Mapping[str, str] = MappingProxyType({}),
    version: int = 1,
    baud: int = 57_600,
    **more: Any,
) -> Interface:
    """The interface of a plain node: the messages of every node, then its own.

    Args:
        name: of the device, in any case.
        i2c_address: 7 bits; also the node type in telemetry Identification.
        telecommands: its own, by ascending ID, 3 to 127.
        telemetries: its own, by ascending ID, 132 to 255.
        flags: its own error flags, each with its cause.
        version: that the node reports.
        baud: default baud rate of its serial line.
        more: further attributes of `Interface`.

    Raises InterfaceError.
    """
    return Interface(
        name=name,
        version=version,
        i2c_address=i2c_address,
        baud=baud,
        telecommands=(*NODE_TELECOMMANDS, *telecommands),
        telemetries=(*node_telemetry(i2c_address, flags), *telemetries),
        ack_errors=AckError,
        **more,
    )
