from typing import Any

import pytest

from cubestack.firmware_model.interface.codec.field import InterfaceError
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.errors import CommandRefusedError, NoAnswerError, NotSupportedError

from ..conftest import I2cLink, over_i2c


@pytest.fixture
def client(i2c: I2cLink) -> I2cClient:
    return I2cClient(i2c, INTERFACE, wait=i2c.waits.append)


def test_telecommand_waits_until_processed_or_times_out(node: Any, i2c: Any) -> None:
    client = I2cClient(i2c, INTERFACE, wait=i2c.waits.append, processing_timeout_s=0.5)
    node.busy = 4
    client.command("CaptureImage")
    assert len(i2c.waits) == 4
    node.busy = 10**6
    with pytest.raises(NoAnswerError, match=r"not processed within 0.5 s"):
        client.command("CaptureImage")
    assert sum(i2c.waits[4:]) == pytest.approx(0.5)


def test_invalid_parameters_are_not_sent(client: I2cClient, node: Any) -> None:
    with pytest.raises(CommandRefusedError, match=r"BAD_PARAMETER \(3\), IdMode is out of range"):
        client.command("setIDMode", IdMode=7)
    with pytest.raises(InterfaceError, match="did you mean IdMode"):
        client.command("setIDMode", IdMod=0)
    assert node.log == []


def test_error_code_in_the_acknowledge_telemetry_is_raised(sense: Any) -> None:
    client = over_i2c(sense)
    client.command("CaptureAndDetect", Camera=0, Sram=0)
    for code, text in ((4, r"BUFFER_FULL \(4\)"), (99, r"unknown code \(99\)")):
        sense.values["TcmdProcessed"] = {"Error": code}
        with pytest.raises(CommandRefusedError, match=f"CaptureAndDetect refused: {text}"):
            client.command("CaptureAndDetect", Camera=0, Sram=0)


def test_telemetry_is_retried(client: I2cClient, i2c: Any) -> None:
    assert client.telemetry("TcmdProcessed") == {"Processed": 1}
    assert client.exchanges.repeated == 0
    i2c.failures = 2
    assert client.telemetry("TcmdProcessed") == {"Processed": 1}
    assert client.exchanges.repeated == 2


def test_telecommand_without_acknowledge_is_not_retried(
    client: I2cClient, node: Any, i2c: Any
) -> None:
    i2c.failures = 1
    with pytest.raises(NoAnswerError, match="CaptureImage not acknowledged"):
        client.command("CaptureImage")
    assert node.log == []


def test_silent_address_is_named(i2c: Any) -> None:
    client = I2cClient(i2c, INTERFACE, 0x55, wait=i2c.waits.append)
    with pytest.raises(NoAnswerError, match=r"telemetry ErrorFlags .* address 0x55 in 3 attempts"):
        client.telemetry("ErrorFlags")
    with pytest.raises(NoAnswerError, match=r"telecommand Reset not acknowledged .* 0x55"):
        client.command("Reset")


def test_unsupported_telemetry_is_not_requested(either_client: Any, node: Any) -> None:
    (name,) = (message.name for message in INTERFACE.telemetries if not message.supported)
    with pytest.raises(NotSupportedError, match=f"telemetry {name} is not supported by the node"):
        either_client.telemetry(name)
    assert node.log == []
