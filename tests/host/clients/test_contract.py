from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.codec.field import InterfaceError, u8
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.firmware_model.interface.codec.node_messages import node_interface
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.firmware_model.interface.cubestar import AckError
from cubestack.host.clients.aramis.client import Aramis
from cubestack.host.clients.contract import Client, DeviceClient, Exchanges
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.quaternions import unit_quaternion
from cubestack.host.clients.registers import RegisterClient
from cubestack.host.devices.node_device import client_type
from cubestack.host.devices.registry import device
from cubestack.host.errors import BadAnswerError, CommandRefusedError, NoAnswerError, TargetError
from cubestack.host.ground.session import TargetSession
from cubestack.host.recording.transcript import transcript
from cubestack.host.targets import open_target

from ..conftest import FakeNode, Slave, UartLink, over_i2c


@pytest.mark.parametrize("message", CUBESTAR.telecommands, ids=lambda m: m.name)
def test_every_telecommand_arrives_with_its_parameters(
    node: FakeNode, either_client: NodeClient | I2cClient, message: Message
) -> None:
    either_client.command(message.name, **message.reset_values())
    assert node.log == [(message.name, message.reset_values())]


DEVICES = pytest.mark.parametrize(
    ("interface", "device"), [(CUBESTAR, CubeStar), (ARAMIS, Aramis)], ids=["cubestar", "aramis"]
)


@DEVICES
def test_full_buffer_is_retried_once(interface: Interface, device: type[DeviceClient]) -> None:
    node = FakeNode(interface)
    client = device(NodeClient(UartLink(node), interface))
    node.refusals.append(AckError.BUFFER_FULL)
    client.perform("StopLoop")
    node.refusals.extend([AckError.BUFFER_FULL] * 2)
    with pytest.raises(CommandRefusedError, match="BUFFER_FULL"):
        client.perform("StopLoop")
    assert [name for name, _ in node.log] == ["StopLoop"]


@DEVICES
def test_client_rejects_streams_over_i2c(interface: Interface, device: type[Any]) -> None:
    client = device(over_i2c(FakeNode(interface)))
    assert client.stars() == []
    with pytest.raises(TypeError, match=r"StreamDownImage: .* over a UART only"):
        client._stream("StreamDownImage", 1, 128, None)


@pytest.mark.parametrize("wrong", [{}, {"Q3": 0.5}, {"Q0": 2.0}, {"Q1": float("nan")}])
def test_rejects_a_quaternion_that_is_no_rotation(wrong: dict[str, float]) -> None:
    values = dict.fromkeys(("Q0", "Q1", "Q2", "Q3"), 0.0) | wrong
    with pytest.raises(BadAnswerError, match=r"quaternion has length (0|0\.5|2|nan), not 1"):
        unit_quaternion(values)


def test_image_request_is_rejected_where_unsupported(node: FakeNode) -> None:
    with pytest.raises(TargetError, match="CubeStar sends no picture"):
        DeviceClient(NodeClient(UartLink(node), CUBESTAR)).picture()
    with pytest.raises(TargetError, match="AraMiS sends its image over a serial line only"):
        Aramis(over_i2c(FakeNode(ARAMIS))).picture()


def test_counts_lost_and_refused_answers(node: Any, uart: Any) -> None:
    client = NodeClient(uart, node.interface)
    node.lost = 2
    client.telemetry("Identification")
    assert client.exchanges == Exchanges(sent=3, answered=1, late=2, repeated=2)
    node.refusals.append(AckError.BUFFER_FULL)
    with pytest.raises(CommandRefusedError):
        client.command("StopLoop")
    assert client.exchanges == Exchanges(sent=4, answered=2, late=2, repeated=2, refused=1)
    node.lost = 1
    with pytest.raises(NoAnswerError):
        client.command("StopLoop")
    assert client.exchanges == Exchanges(sent=5, answered=2, late=3, repeated=2, refused=1)


def test_counts_streamed_frames(node: Any, uart: Any) -> None:
    client = NodeClient(uart, node.interface)
    uart.later += encode_frame(b"\x07") * 3
    assert len([*client.stream("StreamDownImage", 3)]) == 3
    assert client.exchanges == Exchanges(sent=1, answered=1, streamed=3)


def test_counts_transfers_without_acknowledge(node: Any) -> None:
    client = over_i2c(node)
    client._bus.failures = 1  # type: ignore[attr-defined]
    client.telemetry("Identification")
    assert client.exchanges == Exchanges(sent=2, answered=1, late=1, repeated=1)
    with pytest.raises(CommandRefusedError, match="out of range"):  # here, before it is sent
        client.command("setStarPixels", MinPixels=101, MaxPixels=100)
    assert client.exchanges.sent == 2


def test_counts_register_transfers() -> None:
    registers = device("cubesense").interface.registers
    slave = Slave()
    slave.failures = [0]
    client = RegisterClient(slave, registers, wait=lambda _s: None)
    client.read("SUN_GAIN")
    assert client.exchanges == Exchanges(sent=2, answered=1, late=1, repeated=1)
    assert client.exchanges + client.exchanges == Exchanges(sent=4, answered=2, late=2, repeated=2)


def test_page_counters_match_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "a.rec"
    target = open_target("emulated:cubesense", record=path)
    session = TargetSession(target)
    session.execute("write DetectionThreshold1 77").result()
    session.read(["Configuration", "Identification"]).result()
    session.results().result()
    health = session.health
    session.close()
    messages = transcript(load_recording(path), target.interface)
    assert (health["sent"], health["answered"], health["late"]) == (len(messages), len(messages), 0)
    assert len(messages) > 5


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
