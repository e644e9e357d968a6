import pytest

from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR

INTERFACES = (CUBESTAR, CUBESENSE, ARAMIS)
MESSAGES = [
    pytest.param(message, id=f"{interface.name}-{message.name}-{message.id}")
    for interface in INTERFACES
    for message in interface.messages
]
each = pytest.mark.parametrize("interface", INTERFACES, ids=lambda interface: interface.name)


@pytest.mark.parametrize("message", MESSAGES)
def test_every_message_and_field_is_explained_and_round_trips(message: Message) -> None:
    for text in [message.meaning, *(field.meaning for field in message.fields)]:
        assert 2 < len(text) < 100
        assert not text.endswith(".")
    for byte in (0x00, 0x55, 0xAA, 0x1F):
        values = message.unpack(bytes([byte]) * message.length)
        assert message.unpack(message.pack(**values)) == values
    if message.kind is MessageKind.TELECOMMAND:
        assert message.violations(message.reset_values()) == []


@each
def test_every_range_flag_is_an_error_flag(interface: Interface) -> None:
    named = {f.range_flag for m in interface.messages for f in m.fields} - {""}
    shown = {f.flag for m in interface.messages for f in m.fields} - {""}
    assert named <= shown


@each
def test_error_codes_are_listed_once(interface: Interface) -> None:
    assert interface.ack_errors not in interface.choices
    assert [int(code) for code in interface.ack_errors] == [0, 1, 2, 3, 4]
    assert all(message.kind is MessageKind.TELECOMMAND for message in interface.telecommands)
