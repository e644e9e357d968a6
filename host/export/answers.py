"""Answers with an ID, for tools that recognise a packet by its content.

An answer of the node protocol is data alone, or one error byte (``firmware_model.node.link``). Who
reads the line for such a tool puts one byte before the answer: the ID of the requested telemetry,
or ``ACKNOWLEDGE_ID`` and the ID of the acknowledged telecommand.
"""

from enum import IntEnum

from cubestack.firmware_model.interface.codec.field import enum8
from cubestack.firmware_model.interface.codec.message import Interface, Message

#: No telemetry frame has it: their IDs have the highest bit.
ACKNOWLEDGE_ID = 0


def answers(interface: Interface) -> tuple[Message, ...]:
    """What may come from the device, the byte before it apart: acknowledge, then telemetry."""
    names = {0: "NONE"} | {message.id: message.name.upper() for message in interface.telecommands}
    named = IntEnum("Telecommand", {name: number for number, name in names.items()})  # type: ignore[misc]
    acknowledge = Message(ACKNOWLEDGE_ID, "Acknowledge", "answer to a telecommand").of(
        enum8("Telecommand", "ID of the telecommand", choices=named),
        enum8("Error", "0, or why it was refused", choices=interface.ack_errors),
    )
    return acknowledge, *requested(interface)


def requested(interface: Interface) -> tuple[Message, ...]:
    """Telemetry that the device answers."""
    return tuple(message for message in interface.telemetries if message.supported)
