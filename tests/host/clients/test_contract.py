from typing import Any

import pytest

from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.codec.message import Interface, Message
from cubestack.firmware_model.interface.codec.node_codes import AckError
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.host.clients.aramis.client import Aramis
from cubestack.host.clients.contract import DeviceClient
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.quaternions import unit_quaternion
from cubestack.host.errors import BadAnswerError, CommandRefusedError, TargetError

from ..conftest import FakeNode, UartLink, over_i2c


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
def test_i2c_has_no_stream(interface: Interface, device: type[Any]) -> None:
    client = device(over_i2c(FakeNode(interface)))
    assert client.stars() == []
    with pytest.raises(TypeError, match=r"StreamDownImage: .* over a UART only"):
        client._stream("StreamDownImage", 1, 128, None)


@pytest.mark.parametrize("wrong", [{}, {"Q3": 0.5}, {"Q0": 2.0}, {"Q1": float("nan")}])
def test_rejects_a_quaternion_that_is_no_rotation(wrong: dict[str, float]) -> None:
    values = dict.fromkeys(("Q0", "Q1", "Q2", "Q3"), 0.0) | wrong
    with pytest.raises(BadAnswerError, match=r"quaternion has length (0|0\.5|2|nan), not 1"):
        unit_quaternion(values)


def test_picture_is_rejected_where_there_is_none(node: FakeNode) -> None:
    with pytest.raises(TargetError, match="CubeStar sends no picture"):
        DeviceClient(NodeClient(UartLink(node), CUBESTAR)).picture()
    with pytest.raises(TargetError, match="AraMiS sends its image over a serial line only"):
        Aramis(over_i2c(FakeNode(ARAMIS))).picture()
