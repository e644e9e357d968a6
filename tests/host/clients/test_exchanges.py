from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import AckError
from cubestack.host.clients.contract import Exchanges
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.registers import RegisterClient
from cubestack.host.devices.registry import device
from cubestack.host.errors import CommandRefusedError, NoAnswerError
from cubestack.host.ground.session import TargetSession
from cubestack.host.recording.transcript import transcript
from cubestack.host.targets import open_target

from ..conftest import Slave, over_i2c


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
    assert isinstance(client, I2cClient)
    client._bus.failures = 1  # type: ignore[attr-defined]
    client.telemetry("Identification")
    assert client.exchanges == Exchanges(sent=2, answered=1, late=1, repeated=1)
    with pytest.raises(CommandRefusedError, match="out of range"):  # here, before it is sent
        client.command("setStarPixels", MinPixels=101, MaxPixels=100)
    assert client.exchanges.sent == 2


def test_counts_register_transfers() -> None:
    registers = device("cubesense").interface.registers
    assert registers is not None
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
