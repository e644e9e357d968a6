import copy
import pickle

import pytest

from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubesense import pins as cubesense
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.firmware_model.interface.cubestar import pins as cubestar
from cubestack.firmware_model.interface.pins import Direction, Pin, Port, resized, sram_pins
from tests.together import together

INTERFACES = (CUBESTAR, CUBESENSE, ARAMIS)
MESSAGES = [
    pytest.param(message, id=f"{interface.name}-{message.name}-{message.id}")
    for interface in INTERFACES
    for message in interface.messages
]
each = pytest.mark.parametrize("interface", INTERFACES, ids=lambda interface: interface.name)


@together("message", MESSAGES)
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


@pytest.mark.parametrize(
    ("direction", "ports"),
    [
        ("input", [Port("X", False, 2, 3)]),
        ("output", [Port("X", True, 2, 3)]),
        ("tristate", [Port("X_O", True, 2), Port("X_OE", True, 1)]),
        ("inout", [Port("X_I", False, 2, 3), Port("X_O", True, 2), Port("X_OE", True, 1)]),
    ],
)
def test_pin_direction_defines_its_ports(direction: Direction, ports: list[Port]) -> None:
    """The level is an input's, or that of an output that is never off."""
    assert list(Pin("X", direction, "", 2, level=3).ports) == ports


def test_pin_copy_keeps_unchanged_attributes() -> None:
    pin = Pin("X", "inout", "a bus", 8, level=7, enables=8, bare=True)
    other = pin.copy("Y", meaning="another bus", width=4)
    assert [port.name for port in other.ports] == ["Y_I", "Y", "Y_OE"]
    assert (other.width, other.level, other.enables, other.meaning) == (4, 7, 8, "another bus")
    assert [port.name for port in pin.copy(width=4).ports] == ["X_I", "X", "X_OE"]


def test_pin_equals_its_name_and_keeps_its_details_when_copied() -> None:
    pin = Pin("X", "input", "a pin")
    assert pin == "X"
    assert {"X": 1}[pin] == 1
    assert repr(pin) == "'X'"
    for same in (copy.deepcopy(pin), pickle.loads(pickle.dumps(pin))):
        assert (same, same.meaning, same.ports) == ("X", "a pin", pin.ports)


def test_resized_pins_have_the_given_width() -> None:
    address, *others = resized(sram_pins(20), SRAM_A=7)
    assert address.width == 7
    assert [pin.width for pin in others] == [8, 1, 1, 1]


TABLES = {
    **{name: getattr(cubestar, name) for name in ("PUBLISHED", "SHARED", "DOUBLE", "TWO_BOARDS")},
    **{name: getattr(cubesense, name) for name in ("FPGA", "ADDRESSING")},
    "pair": cubesense.pair_pins(),
    "addressing pair": cubesense.pair_pins(mcu_addressing=True),
}


@pytest.mark.parametrize("name", TABLES)
def test_pins_and_ports_are_unique(name: str) -> None:
    table: tuple[Pin, ...] = TABLES[name]
    assert len(set(table)) == len(table)
    ports = [port.name for pin in table for port in pin.ports]
    assert len(set(ports)) == len(ports)
    assert all(pin.meaning for pin in table)
