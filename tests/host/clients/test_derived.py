from typing import Any

import pytest

from cubestack.firmware_model.interface.codec.field import InterfaceError, u8
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.node_messages import node_interface
from cubestack.host.clients.contract import Client
from cubestack.host.devices.node_device import client_type

PAIR = u8("First", "one"), u8("Second", "another")
INTERFACE = node_interface(
    "Plain",
    i2c_address=0x30,
    telecommands=[
        Message(10, "SetADCPair", "set both").of(*PAIR),
        Message(11, "Close", "a name that every client has"),
    ],
    telemetries=[
        Message(140, "ADCPair", "both").of(*PAIR),
        Message(141, "Hidden", "not served", supported=False),
    ],
)


class Spy(Client):
    interface = INTERFACE

    def __init__(self) -> None:
        self.sent: list[tuple[str, dict[str, object]]] = []

    def command(self, name: str, **parameters: object) -> None:
        INTERFACE.telecommand(name).pack(**parameters)
        self.sent.append((name, parameters))

    def telemetry(self, name: str) -> dict[str, Any]:
        return INTERFACE.telemetry(name).reset_values() | {"Processed": 1}

    def pause(self, seconds: float) -> None: ...

    def close(self) -> None:
        self.sent.append(("close", {}))


@pytest.fixture
def spy() -> Spy:
    return Spy()


@pytest.fixture
def client(spy: Spy) -> Any:
    return client_type(INTERFACE)(spy)


def test_telecommands_take_parameters_by_position_or_name(spy: Spy, client: Any) -> None:
    client.set_adc_pair(1, 2)
    client.set_adc_pair(1, Second=3)
    assert spy.sent == [
        ("SetADCPair", {"First": 1, "Second": 2}),
        ("SetADCPair", {"First": 1, "Second": 3}),
    ]
    with pytest.raises(InterfaceError, match="SetADCPair takes 2 values, not 3"):
        client.set_adc_pair(1, 2, 3)
    with pytest.raises(InterfaceError, match="SetADCPair has no field 'Third'"):
        client.set_adc_pair(1, 2, Third=3)


def test_telemetry_returns_fields_by_name(client: Any) -> None:
    assert client.adc_pair()["Second"] == 0
    assert client.adc_pair.__doc__ == "both"


def test_message_name_does_not_replace_a_client_method(spy: Spy, client: Any) -> None:
    client.close()
    assert spy.sent == [("close", {})]


def test_unsupported_messages_have_no_method(client: Any) -> None:
    assert type(client).__name__ == "Plain"
    assert not hasattr(client, "hidden")
