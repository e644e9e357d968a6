import re
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.firmware_model.interface.codec.field import InterfaceError
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar import INTERFACE, AckError
from cubestack.host.clients.contract import POLL_PERIOD_S
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import MAX_READS, NodeClient
from cubestack.host.errors import (
    BadAnswerError,
    CommandRefusedError,
    NoAnswerError,
    NotSupportedError,
)

from ..conftest import I2cLink, LetterLine, over_i2c


@pytest.fixture
def client(uart: Any) -> NodeClient:
    return NodeClient(uart, INTERFACE)


@pytest.mark.parametrize(
    "message", [m for m in INTERFACE.telemetries if m.supported], ids=lambda m: m.name
)
@settings(max_examples=20)
@given(data=st.data())
def test_every_telemetry_frame_arrives(message: Message, data: st.DataObject) -> None:
    raw = data.draw(st.binary(min_size=message.length, max_size=message.length))
    request = encode_frame(bytes([message.id])).decode("latin-1")
    line = LetterLine(**{request: encode_frame(raw)})
    answer = NodeClient(line, INTERFACE).telemetry(message.name)
    assert str(answer) == str(message.unpack(raw))  # as text, because NaN differs from itself


@pytest.mark.parametrize("chunk", [1, 2, 7, 4096])
def test_accepts_answers_in_pieces_after_noise(
    client: NodeClient, uart: Any, node: Any, chunk: int
) -> None:
    uart.chunk = chunk
    uart.mangle = lambda data: b"\xff\x00\x1f\x1f" + data
    node.values["PowerStatus"] = {"Current": 177}
    assert client.telemetry("powerstatus")["Current"] == 177


def test_extra_and_late_answers_are_dropped(client: NodeClient, uart: Any) -> None:
    uart.pending += encode_frame(b"\x07")
    assert client.telemetry("TcmdProcessed") == {"Processed": 1}
    uart.mangle = lambda data: data + encode_frame(b"\x07")
    assert client.telemetry("TcmdProcessed") == {"Processed": 1}
    uart.mangle = lambda data: data
    assert client.telemetry("TcmdProcessed") == {"Processed": 1}


@pytest.mark.parametrize("code", [error for error in AckError if error])
def test_refusal_names_the_telecommand_and_the_error(
    client: NodeClient, node: Any, code: AckError
) -> None:
    node.refusals.append(code)
    with pytest.raises(CommandRefusedError) as caught:
        client.command("DetectStars")
    assert str(caught.value) == f"telecommand DetectStars refused: {code.name} ({code.value})"
    assert caught.value.code is code


def test_refusals_of_the_node_are_raised(client: NodeClient, uart: Any) -> None:
    with pytest.raises(CommandRefusedError, match=r"setIDMode refused: BAD_PARAMETER \(3\)"):
        client.command("setIDMode", IdMode=7)
    uart.mangle = lambda _data: encode_frame(b"\x63")
    with pytest.raises(CommandRefusedError, match=r"unknown code \(99\)"):
        client.command("DetectStars")


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("Expsure", {"exposure": 1}, "no telecommand 'Expsure'; did you mean Exposure?"),
        ("Exposure", {"exposre": 1}, "no field 'exposre'; did you mean exposure?"),
        ("Exposure", {"exposure": 70_000}, "70000 does not fit; u16 carries 0 to 65535 lines"),
    ],
)
def test_unknown_names_and_values_are_not_sent(
    client: NodeClient, node: Any, name: str, parameters: dict[str, Any], message: str
) -> None:
    with pytest.raises(InterfaceError, match=re.escape(message)):
        client.command(name, **parameters)
    assert node.log == []


def test_telemetry_is_requested_three_times(client: NodeClient, node: Any, uart: Any) -> None:
    node.lost = 2
    assert client.telemetry("Identification")["InterfaceVersion"] == 0
    node.lost = 3
    uart.silences.clear()
    with pytest.raises(NoAnswerError, match=r"telemetry ErrorFlags within 1 s in 3 attempts"):
        client.telemetry("ErrorFlags")
    assert [silence for silence in uart.silences if silence] == [1.0, 1.0, 1.0]


def test_telecommands_are_not_retried(client: NodeClient, node: Any) -> None:
    node.lost = 1
    with pytest.raises(TimeoutError, match="no acknowledge of telecommand CaptureImage within 1 s"):
        client.command("CaptureImage")
    assert [name for name, _ in node.log] == ["CaptureImage"]


def test_rejects_answers_of_a_wrong_length(client: NodeClient, uart: Any) -> None:
    uart.mangle = lambda _data: encode_frame(b"abc")
    with pytest.raises(BadAnswerError, match="telemetry Quaternion has 3 bytes, not 8"):
        client.telemetry("Quaternion")
    with pytest.raises(BadAnswerError, match="acknowledge of telecommand Reset has 3 bytes, not 1"):
        client.command("Reset")


def test_endless_noise_counts_as_no_answer() -> None:
    class Babble(LetterLine):
        reads = 0

        def read(self, max_bytes: int, timeout_s: float) -> bytes:
            self.reads += 1
            return b"\x55"

    line = Babble()
    assert NodeClient(line, INTERFACE, retries=0).request(b"\x80") is None
    assert line.reads == 2 * MAX_READS


def test_wait_processed_polls_until_done_or_time_out(
    client: NodeClient, node: Any, uart: Any
) -> None:
    node.busy = 5
    client.command("DetectStars")
    client.wait_processed(1.0)
    assert uart.silences.count(POLL_PERIOD_S) == 5
    client.command("DetectStars")
    with pytest.raises(NoAnswerError, match=r"not processed within 0.03 s"):
        client.wait_processed(0.03)


def test_with_block_closes_the_transport(uart: Any) -> None:
    closed = []
    uart.close = lambda: closed.append(True)
    with NodeClient(uart, INTERFACE) as client:
        client.command("Reset")
    assert closed == [True]


@pytest.fixture
def i2c_client(i2c: I2cLink) -> I2cClient:
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


def test_invalid_parameters_are_not_sent(i2c_client: I2cClient, node: Any) -> None:
    with pytest.raises(CommandRefusedError, match=r"BAD_PARAMETER \(3\), IdMode is out of range"):
        i2c_client.command("setIDMode", IdMode=7)
    with pytest.raises(InterfaceError, match="did you mean IdMode"):
        i2c_client.command("setIDMode", IdMod=0)
    assert node.log == []


def test_error_code_in_the_acknowledge_telemetry_is_raised(sense: Any) -> None:
    client = over_i2c(sense)
    client.command("CaptureAndDetect", Camera=0, Sram=0)
    for code, text in ((4, r"BUFFER_FULL \(4\)"), (99, r"unknown code \(99\)")):
        sense.values["TcmdProcessed"] = {"Error": code}
        with pytest.raises(CommandRefusedError, match=f"CaptureAndDetect refused: {text}"):
            client.command("CaptureAndDetect", Camera=0, Sram=0)


def test_telemetry_is_retried(i2c_client: I2cClient, i2c: Any) -> None:
    assert i2c_client.telemetry("TcmdProcessed") == {"Processed": 1}
    assert i2c_client.exchanges.repeated == 0
    i2c.failures = 2
    assert i2c_client.telemetry("TcmdProcessed") == {"Processed": 1}
    assert i2c_client.exchanges.repeated == 2


def test_telecommand_without_acknowledge_is_not_retried(
    i2c_client: I2cClient, node: Any, i2c: Any
) -> None:
    i2c.failures = 1
    with pytest.raises(NoAnswerError, match="CaptureImage not acknowledged"):
        i2c_client.command("CaptureImage")
    assert node.log == []


def test_i2c_client_names_a_silent_address(i2c: Any) -> None:
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
