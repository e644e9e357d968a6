from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pytest
from smbus2 import i2c_msg

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.errors import RecordingMismatchError
from cubestack.host.recording.host_recorder import HostRecorder
from cubestack.host.recording.playback import RecordedI2c, RecordedTransport


@pytest.fixture
def tape(tmp_path: Path) -> Iterator[HostRecorder]:
    """Records to a.rec; every look at its clock costs 1 ms."""
    looks = count(10**15, 1_000_000)
    with (tmp_path / "a.rec").open("w", buffering=1) as stream:
        made = HostRecorder(stream, clock_ns=lambda: next(looks))
        made.begin("cubestar", {"uart": 57_600})
        yield made


def session(client: NodeClient | I2cClient) -> list[object]:
    client.command("setDetectionThresholds", DetectionThreshold=7, StarThreshold=8)
    return [CubeStar(client).task_status(), client.telemetry("Identification")]


def test_serial_session(node, uart, tape, tmp_path):
    node.values["TaskStatus"]["taskStatus"] = 1
    before = session(NodeClient(tape.line(uart, "uart", 57_600), INTERFACE))
    recording = load_recording(tmp_path / "a.rec")
    assert session(NodeClient(RecordedTransport(recording, INTERFACE), INTERFACE)) == before


def test_lost_answers_are_lost_again(node, uart, tape, tmp_path):
    node.lost = 2
    line = tape.line(uart, "uart", 57_600)
    before = NodeClient(line, INTERFACE).telemetry("Identification")
    recording = load_recording(tmp_path / "a.rec")
    replayed = NodeClient(RecordedTransport(recording, INTERFACE), INTERFACE)
    assert replayed.telemetry("Identification") == before
    with pytest.raises(RecordingMismatchError, match="the recording ends"):
        replayed.telemetry("Identification")


def test_i2c_session(node, i2c, tape, tmp_path):
    node.values["TaskStatus"]["taskStatus"] = 1
    i2c.failures = 1
    bus = tape.bus(i2c)
    with pytest.raises(OSError, match="Remote I/O"):
        bus.i2c_rdwr(i2c_msg.write(i2c.address, [0x80]), i2c_msg.read(i2c.address, 8))
    before = session(I2cClient(bus, INTERFACE, wait=lambda _s: None))
    recorded = RecordedI2c(load_recording(tmp_path / "a.rec"), INTERFACE)
    with pytest.raises(OSError, match="failed when it was recorded"):
        recorded.i2c_rdwr(i2c_msg.write(i2c.address, [0x80]), i2c_msg.read(i2c.address, 8))
    assert session(I2cClient(recorded, INTERFACE, wait=lambda _s: None)) == before


def test_times_run_forward(node, uart, tape, tmp_path):
    client = NodeClient(tape.line(uart, "uart", 57_600), INTERFACE)
    for _ in range(5):
        client.telemetry("ImageBlock")
    blocks = list(load_recording(tmp_path / "a.rec").line("uart"))
    ends = [block.time_ps + len(block.data) * block.byte_ps for block in blocks]
    assert all(end <= block.time_ps for end, block in zip(ends, blocks[1:], strict=False))
